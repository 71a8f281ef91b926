//! The layout of a map: title above, legend below.

use glam::{DVec2, Vec2};
use image::RgbaImage;
use rayon::prelude::*;

use super::canvas::Canvas;
use super::colour::Rgb;
use super::legend::{self, Entry, Legend, Scale};
use super::symbol::{draw_pin, hatching};
use super::text;
use crate::control::Control;
use crate::error::{Error, Result};
use crate::grid::{GridFrame, round_step};

/// Pixels of the map's longer side by default.
pub(super) const SIDE: u32 = 1600;
/// Fewest and most pixels of the map's longer side.
pub(super) const SIDES: std::ops::RangeInclusive<u32> = 100..=8192;
/// Sizes below are in pixels of a picture of [`SIDE`]; others scale them.
const MARGIN: f32 = 24.0;
const TITLE: f32 = 30.0;
/// Title and legend have this width even around a narrow map.
const NARROWEST: f32 = 760.0;

/// A canvas on which title and legend are drawn, and where the map goes on it.
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
    /// A layout for `frame` whose map has `side` pixels on its longer side, with title and legend drawn.
    pub(super) fn new(
        frame: &GridFrame,
        title: &str,
        side: u32,
        entries: impl IntoIterator<Item = Entry>,
    ) -> Result<Self> {
        if !SIDES.contains(&side) {
            return Err(Error::argument(
                "the longer side of a picture",
                format!("{side} pixels"),
                format!("between {} and {}", SIDES.start(), SIDES.end()),
            ));
        }
        // The map in its proportions on the ground, those of the middle row where they vary.
        let nodes = DVec2::new(frame.cols() as f64, frame.rows() as f64);
        let extent = frame.mid_spacing() * nodes;
        let metres_per_pixel = extent.max_element() / f64::from(side);
        let size = (extent / metres_per_pixel).round().max(DVec2::ONE);
        let unit = (side as f32 / SIDE as f32).clamp(0.5, 4.0);

        let inner = size.as_vec2().x.max(NARROWEST * unit);
        let bar =
            Entry::ScaleBar { metres: round_step(f64::from(100.0 * unit) * metres_per_pixel, 1) };
        let entries = [bar, Entry::North].into_iter().chain(entries);
        let legend = Legend::new(entries, inner, Scale { unit, metres_per_pixel });

        let margin = MARGIN * unit;
        let head = if title.is_empty() { margin } else { margin + 1.6 * TITLE * unit };
        let width = inner + 2.0 * margin;
        let height = head + size.y as f32 + legend.height() + 1.5 * margin;
        let mut canvas = Canvas::new(width.ceil() as u32, height.ceil() as u32)?;
        draw_title(&mut canvas, title, inner, unit);
        legend.draw(&mut canvas, Vec2::new(margin, head + size.y as f32 + 0.5 * margin));

        let left = margin + (inner - size.x as f32) / 2.0;
        let map = [left as usize, head as usize, size.x as usize, size.y as usize];
        Ok(Self { canvas, map, cells: nodes / size, unit })
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
    pub(super) fn to_pixels(&self, grid: DVec2) -> Vec2 {
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
        lines.iter().map(|line| line.iter().map(|&p| self.to_pixels(p)).collect()).collect()
    }

    /// A pin at grid coordinates with a letter or a number.
    pub(super) fn pin(&mut self, grid: DVec2, mark: &str, colour: Rgb) {
        let at = self.to_pixels(grid);
        draw_pin(&mut self.canvas, at, mark, colour, self.unit);
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

/// A title of at most `width` pixels: a long one is set smaller, down to the size of the legend, before it is cut.
fn draw_title(canvas: &mut Canvas, title: &str, width: f32, unit: f32) {
    let size = TITLE * (width / text::width(title, TITLE)).clamp(legend::TEXT / TITLE * unit, unit);
    let baseline = Vec2::new(MARGIN * unit, MARGIN * unit + TITLE * unit);
    canvas.text(&text::fitted(title, size, width), size, baseline, Rgb::INK, 0.0);
}

/// Grid coordinates of a pixel of the map.
fn on_grid(x: usize, y: usize, cells: DVec2) -> DVec2 {
    (DVec2::new(x as f64, y as f64) + 0.5) * cells - 0.5
}
