//! The page of a picture: title above, map, and a footer of scale bar, north arrow and legend.

use glam::{DVec2, Vec2};
use image::RgbaImage;
use rayon::prelude::*;

use super::canvas::Canvas;
use super::colour::Rgb;
use super::relief::VOID;
use super::text;
use crate::control::Control;
use crate::error::{Error, Result};
use crate::grid::{GridFrame, round_step};

/// Pixels of the map's longer side unless told otherwise.
pub(super) const SIDE: u32 = 1600;
/// Fewest and most pixels of the map's longer side.
pub(super) const SIDES: std::ops::RangeInclusive<u32> = 100..=8192;
/// Sizes below are in pixels of a picture of [`SIDE`]; others scale them.
const MARGIN: f32 = 24.0;
const TITLE: f32 = 30.0;
const TEXT: f32 = 22.0;
const FOOTER_ROW: f32 = 44.0;
/// A footer needs this width even below a narrow map.
const NARROWEST: f32 = 760.0;
const SYMBOL: f32 = 46.0;
const GAP: f32 = 34.0;

/// One entry of the footer.
pub(super) enum Item {
    /// A bar that is `metres` long on the map.
    Scale { metres: f64 },
    /// An arrow to map north.
    North,
    /// A line of some width.
    Line { colour: Rgb, width: f32, label: String },
    /// A pin that bears a letter or a number.
    Pin { colour: Rgb, mark: String, label: String },
    /// A patch of ground: a colour, or the hatching of voids.
    Patch { colour: Option<Rgb>, label: String },
    /// A bar of colours with ticks at shares 0 to 1.
    Bar { colours: Vec<Rgb>, ticks: Vec<(f64, String)>, label: String },
}

pub(super) struct MapLayout {
    pub(super) canvas: Canvas,
    /// Corner and size of the map in pixels.
    map: [usize; 4],
    /// Grid cells per pixel.
    cells: DVec2,
    /// Factor on every length of the layout.
    pub(super) unit: f32,
}

impl MapLayout {
    /// A layout for `frame` whose map has `side` pixels on its longer side, with the footer drawn.
    pub(super) fn new(
        frame: &GridFrame,
        title: &str,
        side: u32,
        legend: impl IntoIterator<Item = Item>,
    ) -> Result<Self> {
        if !SIDES.contains(&side) {
            return Err(Error::argument(
                "the longer side of a picture",
                format!("{side} pixels"),
                format!("between {} and {}", SIDES.start(), SIDES.end()),
            ));
        }
        // The map in its proportions on the ground, those of the middle row where they vary.
        let extent = frame.mid_spacing() * DVec2::new(frame.cols() as f64, frame.rows() as f64);
        let metres_per_pixel = extent.max_element() / f64::from(side);
        let size = (extent / metres_per_pixel).round().max(DVec2::ONE);
        let unit = (side as f32 / SIDE as f32).clamp(0.5, 4.0);

        let bar = round_step(f64::from(100.0 * unit) * metres_per_pixel, 1);
        let mut items = vec![Item::Scale { metres: bar }, Item::North];
        items.extend(legend);
        let inner = size.as_vec2().x.max(NARROWEST * unit);
        let places = flow(&mut items, inner, unit, metres_per_pixel);
        let rows = places.last().map_or(0.0, |p| p.y + 1.0);

        let margin = MARGIN * unit;
        let head = if title.is_empty() { margin } else { margin + 1.6 * TITLE * unit };
        let width = inner + 2.0 * margin;
        let height = head + size.y as f32 + rows * FOOTER_ROW * unit + 1.5 * margin;
        let mut canvas = Canvas::new(width.ceil() as u32, height.ceil() as u32)?;

        // A long title is set smaller, down to the size of the legend, before it is cut.
        let shrink = (inner / text::width(title, TITLE)).clamp(TEXT / TITLE * unit, unit);
        let title = text::fitted(title, TITLE * shrink, inner);
        canvas.text(
            &title,
            TITLE * shrink,
            Vec2::new(margin, margin + TITLE * unit),
            Rgb::INK,
            0.0,
        );
        let left = margin + (inner - size.x as f32) / 2.0;
        let foot = head + size.y as f32 + 0.5 * margin;
        for (item, place) in items.iter().zip(places) {
            let middle = foot + (place.y + 0.5) * FOOTER_ROW * unit;
            item.draw(&mut canvas, Vec2::new(margin + place.x, middle), unit, metres_per_pixel);
        }
        let [w, h] = [size.x as usize, size.y as usize];
        Ok(Self {
            canvas,
            map: [left as usize, head as usize, w, h],
            cells: DVec2::new(frame.cols() as f64, frame.rows() as f64) / size,
            unit,
        })
    }

    /// Paints the ground by `colour` at grid coordinates; `None` is hatched as void.
    ///
    /// # Errors
    /// Cancelled.
    pub(super) fn ground(
        &mut self,
        control: &Control,
        colour: impl Fn(DVec2) -> Option<Rgb> + Sync,
    ) -> Result<()> {
        let cells = self.cells;
        let period = (12.0 * self.unit) as usize;
        self.canvas.paint(self.map, |x, y| {
            if control.cancel.is_cancelled() {
                return Rgb::WHITE;
            }
            colour(on_grid(x, y, cells)).unwrap_or_else(|| hatching(x + y, period))
        });
        control.check()
    }

    /// Corner and size of the map in pixels, and for each of its pixels `value` at grid coordinates, row-major.
    pub(super) fn sample<T: Send>(
        &self,
        value: impl Fn(DVec2) -> T + Sync,
    ) -> ([usize; 4], Vec<T>) {
        let [_, _, width, height] = self.map;
        let pixels = (0..width * height).into_par_iter();
        let values = pixels.map(|i| value(on_grid(i % width, i / width, self.cells)));
        (self.map, values.collect())
    }

    /// Pixel coordinates of grid coordinates.
    pub(super) fn place(&self, grid: DVec2) -> Vec2 {
        let corner = DVec2::new(self.map[0] as f64, self.map[1] as f64);
        (corner + (grid + 0.5) / self.cells).as_vec2()
    }

    /// Whether a pixel is on the map.
    pub(super) fn shows(&self, at: Vec2) -> bool {
        let [left, top, width, height] = self.map.map(|v| v as f32);
        let inside = at - Vec2::new(left, top);
        inside.cmpge(Vec2::ZERO).all() && inside.cmple(Vec2::new(width, height)).all()
    }

    /// Polylines of grid coordinates in pixels.
    pub(super) fn lines(&self, lines: &[Vec<DVec2>]) -> Vec<Vec<Vec2>> {
        lines.iter().map(|line| line.iter().map(|&p| self.place(p)).collect()).collect()
    }

    /// A pin at grid coordinates that bears a letter or a number.
    pub(super) fn pin(&mut self, grid: DVec2, mark: &str, colour: Rgb) {
        let at = self.place(grid);
        pin(&mut self.canvas, at, mark, colour, self.unit);
    }

    /// The finished picture.
    pub(super) fn finish(mut self) -> RgbaImage {
        let [left, top, w, h] = self.map.map(|v| v as f32);
        let corners = [[0.0, 0.0], [w, 0.0], [w, h], [0.0, h], [0.0, 0.0]]
            .map(|c| Vec2::from(c) + Vec2::new(left, top));
        self.canvas.lines(&[corners.to_vec()], self.unit, Rgb(0x77, 0x77, 0x77), 1.0);
        self.canvas.into_image()
    }
}

/// Grid coordinates of a pixel of the map.
fn on_grid(x: usize, y: usize, cells: DVec2) -> DVec2 {
    (DVec2::new(x as f64, y as f64) + 0.5) * cells - 0.5
}

/// Diagonal hatching along the diagonals `x + y`.
fn hatching(diagonal: usize, period: usize) -> Rgb {
    VOID[usize::from(diagonal % period.max(2) < period.div_ceil(6))]
}

fn pin(canvas: &mut Canvas, at: Vec2, mark: &str, colour: Rgb, unit: f32) {
    canvas.disc(at, 14.0 * unit, 3.0 * unit, colour);
    // Long numbers are set smaller.
    let size = 20.0 * unit * (22.0 / text::width(mark, 20.0)).min(1.0);
    // Half of DejaVu's capital height, 0.729 em, centres the mark.
    let baseline = at + Vec2::new(-text::width(mark, size) / 2.0, 0.365 * size);
    canvas.text(mark, size, baseline, Rgb::WHITE, 0.0);
}

/// Places the items in rows of at most `inner` pixels: `(x in pixels, row)` of each. Labels that do
/// not fit even alone are shortened.
fn flow(items: &mut [Item], inner: f32, unit: f32, metres_per_pixel: f64) -> Vec<Vec2> {
    let mut pen = Vec2::ZERO;
    items
        .iter_mut()
        .map(|item| {
            item.shorten(inner, unit);
            let width = item.width(unit, metres_per_pixel);
            if pen.x > 0.0 && pen.x + width > inner {
                pen = Vec2::new(0.0, pen.y + 1.0);
            }
            let place = pen;
            pen.x += width + GAP * unit;
            place
        })
        .collect()
}

impl Item {
    fn label(&self) -> String {
        match self {
            Self::Scale { metres } if *metres >= 1000.0 => {
                format!("{} km", text::number(metres / 1000.0))
            }
            Self::Scale { metres } => format!("{} m", text::number(*metres)),
            Self::North => "N".into(),
            Self::Line { label, .. }
            | Self::Pin { label, .. }
            | Self::Patch { label, .. }
            | Self::Bar { label, .. } => label.clone(),
        }
    }

    /// Pixels of the symbol left of the label.
    fn symbol(&self, unit: f32, metres_per_pixel: f64) -> f32 {
        match self {
            Self::Scale { metres } => (metres / metres_per_pixel) as f32,
            Self::North => 18.0 * unit,
            Self::Pin { .. } => 34.0 * unit,
            Self::Line { .. } | Self::Patch { .. } => SYMBOL * unit,
            Self::Bar { .. } => 420.0 * unit,
        }
    }

    fn width(&self, unit: f32, metres_per_pixel: f64) -> f32 {
        self.symbol(unit, metres_per_pixel) + 10.0 * unit + text::width(&self.label(), TEXT * unit)
    }

    fn shorten(&mut self, inner: f32, unit: f32) {
        let room = inner - self.symbol(unit, 1.0) - 10.0 * unit;
        if let Self::Line { label, .. }
        | Self::Pin { label, .. }
        | Self::Patch { label, .. }
        | Self::Bar { label, .. } = self
        {
            *label = text::fitted(label, TEXT * unit, room);
        }
    }

    /// Draws the item with the middle of its left edge at `at`.
    fn draw(&self, canvas: &mut Canvas, at: Vec2, unit: f32, metres_per_pixel: f64) {
        let width = self.symbol(unit, metres_per_pixel);
        let end = at + Vec2::new(width, 0.0);
        match self {
            Self::Scale { .. } => {
                let tick = Vec2::new(0.0, 7.0 * unit);
                let bar = vec![at - tick, at + tick, at, end, end + tick, end - tick];
                canvas.lines(&[bar], 2.5 * unit, Rgb::INK, 1.0);
            }
            Self::North => {
                let [half, tall] = [9.0 * unit, 14.0 * unit];
                let middle = at + Vec2::new(half, 0.0);
                canvas.polygon(
                    &[
                        middle + Vec2::new(0.0, -tall),
                        middle + Vec2::new(half, tall),
                        middle + Vec2::new(0.0, 0.5 * tall),
                        middle + Vec2::new(-half, tall),
                    ],
                    Rgb::INK,
                );
            }
            Self::Line { colour, width, .. } => {
                canvas.lines(&[vec![at, end]], width * unit, *colour, 1.0);
            }
            Self::Pin { colour, mark, .. } => {
                pin(canvas, at + Vec2::new(17.0 * unit, 0.0), mark, *colour, unit);
            }
            Self::Patch { colour, .. } => {
                let [w, h] = [width, 22.0 * unit].map(|v| v as usize);
                let corner = [at.x as usize, (at.y - 11.0 * unit) as usize, w, h];
                let period = (12.0 * unit) as usize;
                canvas.paint(corner, |x, y| colour.unwrap_or_else(|| hatching(x + y, period)));
            }
            Self::Bar { colours, ticks, .. } => draw_bar(canvas, at, width, unit, colours, ticks),
        }
        let baseline = end + Vec2::new(10.0, 0.36 * TEXT) * unit;
        canvas.text(&self.label(), TEXT * unit, baseline, Rgb::INK, 0.0);
    }
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
