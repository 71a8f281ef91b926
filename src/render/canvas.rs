//! A raster of pixels and the few shapes that our pictures need.

use glam::Vec2;
use image::RgbaImage;
use rayon::prelude::*;
use tiny_skia::{
    Color, FillRule, LineCap, LineJoin, Paint, Path, PathBuilder, Pixmap, Stroke, Transform,
};

use super::colour::Rgb;
use super::text;
use crate::error::{Error, Result};

/// Lines with vertices closer than this, in pixels, are thinned: nobody can see more.
const FINEST: f32 = 0.4;

/// An opaque raster to draw on, white at first. Pixel coordinates run right and down.
pub(super) struct Canvas {
    pixels: Pixmap,
}

impl Canvas {
    pub(super) fn new(width: u32, height: u32) -> Result<Self> {
        let mut pixels = Pixmap::new(width, height).ok_or_else(|| {
            Error::argument(
                "the size of a picture",
                format!("{width} × {height} pixels"),
                "1 × 1 or more, and one that fits in memory",
            )
        })?;
        pixels.fill(Color::WHITE);
        Ok(Self { pixels })
    }

    /// The finished picture. All of it is opaque, so premultiplied colours are plain ones.
    pub(super) fn into_image(self) -> RgbaImage {
        let (width, height) = (self.pixels.width(), self.pixels.height());
        RgbaImage::from_raw(width, height, self.pixels.take()).expect("four bytes for each pixel")
    }

    /// Sets each pixel of a rectangle to `colour(x, y)`, counted from its corner at `left`, `top`.
    pub(super) fn paint(
        &mut self,
        [left, top, width, height]: [usize; 4],
        colour: impl Fn(usize, usize) -> Rgb + Sync,
    ) {
        let stride = 4 * self.pixels.width() as usize;
        let rows = self.pixels.data_mut().par_chunks_exact_mut(stride).skip(top).take(height);
        rows.enumerate().for_each(|(y, row)| {
            for (x, pixel) in row.chunks_exact_mut(4).skip(left).take(width).enumerate() {
                let Rgb(r, g, b) = colour(x, y);
                pixel.copy_from_slice(&[r, g, b, 255]);
            }
        });
    }

    /// Fills a polygon.
    pub(super) fn polygon(&mut self, points: &[Vec2], colour: Rgb) {
        if let Some(path) = polyline_path(points, true) {
            self.fill(&path, colour);
        }
    }

    /// Draws polylines, `opacity` between 0 and 1; a line that ends where it began is closed.
    pub(super) fn lines(&mut self, lines: &[Vec<Vec2>], width: f32, colour: Rgb, opacity: f32) {
        let mut all = PathBuilder::new();
        for line in lines {
            let closed = line.len() > 2 && line.first() == line.last();
            if let Some(path) = polyline_path(line, closed) {
                all.push_path(&path);
            }
        }
        if let Some(path) = all.finish() {
            self.stroke(&path, width, colour, opacity);
        }
    }

    /// A filled circle with a white rim.
    pub(super) fn disc(&mut self, centre: Vec2, radius: f32, rim: f32, colour: Rgb) {
        for (radius, colour) in [(radius + rim, Rgb::WHITE), (radius, colour)] {
            if let Some(path) = PathBuilder::from_circle(centre.x, centre.y, radius) {
                self.fill(&path, colour);
            }
        }
    }

    /// Text whose baseline begins at `at`; a white halo of `halo` pixels makes it legible on a map.
    pub(super) fn text(&mut self, text: &str, size: f32, at: Vec2, colour: Rgb, halo: f32) {
        if let Some(path) = text::outline(text, size, at) {
            if halo > 0.0 {
                self.stroke(&path, 2.0 * halo, Rgb::WHITE, 0.85);
            }
            self.fill(&path, colour);
        }
    }

    fn fill(&mut self, path: &Path, colour: Rgb) {
        let paint = paint(colour, 1.0);
        self.pixels.fill_path(path, &paint, FillRule::Winding, Transform::identity(), None);
    }

    fn stroke(&mut self, path: &Path, width: f32, colour: Rgb, opacity: f32) {
        let stroke = Stroke {
            width,
            line_cap: LineCap::Round,
            line_join: LineJoin::Round,
            ..Stroke::default()
        };
        let paint = paint(colour, opacity);
        self.pixels.stroke_path(path, &paint, &stroke, Transform::identity(), None);
    }
}

fn paint(Rgb(r, g, b): Rgb, opacity: f32) -> Paint<'static> {
    let mut paint = Paint { anti_alias: true, ..Paint::default() };
    paint.set_color_rgba8(r, g, b, (opacity.clamp(0.0, 1.0) * 255.0).round() as u8);
    paint
}

fn polyline_path(points: &[Vec2], closed: bool) -> Option<Path> {
    let (&first, rest) = points.split_first()?;
    let mut path = PathBuilder::with_capacity(points.len(), points.len());
    path.move_to(first.x, first.y);
    let mut drawn = first;
    for (i, &p) in rest.iter().enumerate() {
        if p.distance(drawn) >= FINEST || i + 1 == rest.len() {
            path.line_to(p.x, p.y);
            drawn = p;
        }
    }
    if closed {
        path.close();
    }
    path.finish()
}
