//! What stands below a map: scale bar, north arrow, and what the colours mean.

use glam::Vec2;

use super::canvas::Canvas;
use super::colour::Rgb;
use super::symbol::{draw_pin, hatching};
use super::text;

/// Sizes below are in pixels of a picture of the default size; others scale them.
pub(super) const TEXT: f32 = 22.0;
const ROW: f32 = 44.0;
/// Width of a symbol, the space after it, and that between entries.
const SYMBOL: f32 = 46.0;
const SPACE: f32 = 10.0;
const GAP: f32 = 34.0;

/// One entry of a legend.
pub(super) enum Entry {
    /// A bar that is `metres` long on the map.
    ScaleBar { metres: f64 },
    /// An arrow to map north.
    North,
    /// A line of some width.
    Line { colour: Rgb, width: f32, label: String },
    /// A pin with a letter or a number.
    Pin { colour: Rgb, mark: String, label: String },
    /// A patch of ground: a colour, or the hatching of voids.
    Patch { colour: Option<Rgb>, label: String },
    /// A bar of colours with ticks at shares 0 to 1.
    Bar { colours: Vec<Rgb>, ticks: Vec<(f64, String)>, label: String },
}

/// How large things are drawn.
#[derive(Clone, Copy)]
pub(super) struct Scale {
    /// Factor on every length of the layout.
    pub(super) unit: f32,
    /// Metres on the ground in a pixel of the map.
    pub(super) metres_per_pixel: f64,
}

/// Entries in rows.
pub(super) struct Legend {
    scale: Scale,
    /// Each with its x in pixels and its row.
    entries: Vec<(Entry, Vec2)>,
}

impl Legend {
    /// Places the entries in rows of at most `width` pixels. Labels that do not fit even alone are shortened.
    pub(super) fn new(entries: impl IntoIterator<Item = Entry>, width: f32, scale: Scale) -> Self {
        let mut pen = Vec2::ZERO;
        let entries = entries.into_iter().map(|mut entry| {
            entry.shorten(width, scale);
            let needed = entry.width(scale);
            if pen.x > 0.0 && pen.x + needed > width {
                pen = Vec2::new(0.0, pen.y + 1.0);
            }
            let at = pen;
            pen.x += needed + GAP * scale.unit;
            (entry, at)
        });
        Self { scale, entries: entries.collect() }
    }

    /// Height in pixels.
    pub(super) fn height(&self) -> f32 {
        self.entries.last().map_or(0.0, |(_, at)| at.y + 1.0) * ROW * self.scale.unit
    }

    /// Draws the rows below `corner`.
    pub(super) fn draw(&self, canvas: &mut Canvas, corner: Vec2) {
        for (entry, at) in &self.entries {
            let middle = corner.y + (at.y + 0.5) * ROW * self.scale.unit;
            entry.draw(canvas, Vec2::new(corner.x + at.x, middle), self.scale);
        }
    }
}

impl Entry {
    fn label(&self) -> String {
        match self {
            Self::ScaleBar { metres } if *metres >= 1000.0 => {
                format!("{} km", text::number(metres / 1000.0))
            }
            Self::ScaleBar { metres } => format!("{} m", text::number(*metres)),
            Self::North => "N".into(),
            Self::Line { label, .. }
            | Self::Pin { label, .. }
            | Self::Patch { label, .. }
            | Self::Bar { label, .. } => label.clone(),
        }
    }

    /// Pixels of the symbol left of the label.
    fn symbol(&self, Scale { unit, metres_per_pixel }: Scale) -> f32 {
        match self {
            Self::ScaleBar { metres } => (metres / metres_per_pixel) as f32,
            Self::North => 18.0 * unit,
            Self::Pin { .. } => 34.0 * unit,
            Self::Line { .. } | Self::Patch { .. } => SYMBOL * unit,
            Self::Bar { .. } => 420.0 * unit,
        }
    }

    fn width(&self, scale: Scale) -> f32 {
        let label = text::width(&self.label(), TEXT * scale.unit);
        self.symbol(scale) + SPACE * scale.unit + label
    }

    /// Shortens the label until the entry is no wider than `width` pixels.
    fn shorten(&mut self, width: f32, scale: Scale) {
        let room = width - self.symbol(scale) - SPACE * scale.unit;
        if let Self::Line { label, .. }
        | Self::Pin { label, .. }
        | Self::Patch { label, .. }
        | Self::Bar { label, .. } = self
        {
            *label = text::fitted(label, TEXT * scale.unit, room);
        }
    }

    /// Draws the entry with the middle of its left edge at `at`.
    fn draw(&self, canvas: &mut Canvas, at: Vec2, scale: Scale) {
        let unit = scale.unit;
        let width = self.symbol(scale);
        let end = at + Vec2::new(width, 0.0);
        match self {
            Self::ScaleBar { .. } => {
                let tick = Vec2::new(0.0, 7.0 * unit);
                let bar = vec![at - tick, at + tick, at, end, end + tick, end - tick];
                canvas.lines(&[bar], 2.5 * unit, Rgb::INK, 1.0);
            }
            Self::North => draw_north_arrow(canvas, at, unit),
            Self::Line { colour, width, .. } => {
                canvas.lines(&[vec![at, end]], width * unit, *colour, 1.0);
            }
            Self::Pin { colour, mark, .. } => {
                draw_pin(canvas, at + Vec2::new(17.0 * unit, 0.0), mark, *colour, unit);
            }
            Self::Patch { colour, .. } => {
                let [w, h] = [width, 22.0 * unit].map(|v| v as usize);
                let corner = [at.x as usize, (at.y - 11.0 * unit) as usize, w, h];
                let period = (12.0 * unit) as usize;
                canvas.paint(corner, |x, y| colour.unwrap_or_else(|| hatching(x + y, period)));
            }
            Self::Bar { colours, ticks, .. } => draw_bar(canvas, at, width, unit, colours, ticks),
        }
        let baseline = end + Vec2::new(SPACE, 0.36 * TEXT) * unit;
        canvas.text(&self.label(), TEXT * unit, baseline, Rgb::INK, 0.0);
    }
}

fn draw_north_arrow(canvas: &mut Canvas, at: Vec2, unit: f32) {
    let [half, tall] = [9.0 * unit, 14.0 * unit];
    let middle = at + Vec2::new(half, 0.0);
    let corners = [(0.0, -tall), (half, tall), (0.0, 0.5 * tall), (-half, tall)];
    canvas.polygon(&corners.map(|corner| middle + Vec2::from(corner)), Rgb::INK);
}

/// A horizontal colour bar with numbers below.
fn draw_bar(
    canvas: &mut Canvas,
    at: Vec2,
    width: f32,
    unit: f32,
    colours: &[Rgb],
    ticks: &[(f64, String)],
) {
    let top = at.y - 17.0 * unit;
    let [w, h] = [width, 16.0 * unit].map(|v| v as usize);
    canvas.paint([at.x as usize, top as usize, w, h], |x, _| {
        colours[(x * colours.len() / w.max(1)).min(colours.len() - 1)]
    });
    let size = 0.75 * TEXT * unit;
    let mut free = f32::NEG_INFINITY;
    for (share, number) in ticks {
        let x = at.x + *share as f32 * width;
        let foot = Vec2::new(x, top + 16.0 * unit);
        canvas.lines(&[vec![foot, foot + Vec2::new(0.0, 4.0 * unit)]], unit, Rgb::INK, 1.0);
        let half = text::width(number, size) / 2.0;
        if x - half > free {
            let baseline = foot + Vec2::new(-half, 5.0 * unit + 0.8 * size);
            canvas.text(number, size, baseline, Rgb::INK, 0.0);
            free = x + half + 6.0 * unit;
        }
    }
}
