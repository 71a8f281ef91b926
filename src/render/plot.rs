//! Points in the plane of two numbers that span decades.

use glam::{DVec2, Vec2};
use image::RgbaImage;

use super::canvas::Canvas;
use super::colour::Rgb;
use super::png::encode_png;
use super::text;
use crate::error::{Error, Result};

/// Pixels of the picture's side. Lengths below are in pixels of it.
const SIDE: u32 = 1200;
const LEFT: f32 = 130.0;
const RIGHT: f32 = 40.0;
const TOP: f32 = 110.0;
const BOTTOM: f32 = 110.0;
const TEXT: f32 = 24.0;
const MARK: f32 = 9.0;
const GRID: Rgb = Rgb(0xdd, 0xdd, 0xdd);

/// A point of a [`LogPlot`].
#[derive(Clone, Debug)]
pub struct Mark {
    /// Where; 0 lies on the axis.
    pub at: DVec2,
    /// Its colour.
    pub colour: Rgb,
    /// Disc for the first kind, square for the second, diamond for the third, and so on.
    pub kind: usize,
    /// What is written next to it; empty for nothing.
    pub label: String,
}

/// A plot with logarithmic axes.
#[derive(Clone, Debug, Default)]
pub struct LogPlot {
    /// The points, drawn in this order.
    pub marks: Vec<Mark>,
    /// What each kind of mark stands for.
    pub kinds: Vec<String>,
    /// What the axes are, x and y.
    pub axes: [String; 2],
    /// The line above.
    pub title: String,
}

impl LogPlot {
    /// Draws the plot, 1200 × 1200 pixels.
    ///
    /// # Errors
    /// [`Error::Argument`] for a coordinate that is negative or not finite.
    pub fn render(&self) -> Result<RgbaImage> {
        if self.marks.iter().any(|m| !m.at.is_finite() || m.at.min_element() < 0.0) {
            return Err(Error::argument(
                "a coordinate of a point of a plot",
                "negative or not finite",
                "0 or more",
            ));
        }
        let mut canvas = Canvas::new(SIDE, SIDE)?;
        let axes = Axes([0, 1].map(|axis| decades(self.marks.iter().map(|mark| mark.at[axis]))));
        axes.draw(&mut canvas);
        for mark in &self.marks {
            draw_mark(&mut canvas, axes.to_pixels(mark.at), mark.kind, mark.colour);
        }
        for mark in &self.marks {
            let right_of_it = axes.to_pixels(mark.at) + Vec2::new(16.0, 6.0);
            canvas.text(&mark.label, 0.7 * TEXT, right_of_it, Rgb::INK, 2.0);
        }
        self.draw_words(&mut canvas);
        Ok(canvas.into_image())
    }

    /// [`render`](Self::render) as a PNG file.
    ///
    /// # Errors
    /// As [`render`](Self::render).
    pub fn png(&self) -> Result<Vec<u8>> {
        encode_png(&self.render()?)
    }

    fn draw_words(&self, canvas: &mut Canvas) {
        let side = SIDE as f32;
        let title = text::fitted(&self.title, 1.2 * TEXT, side - LEFT - RIGHT);
        canvas.text(&title, 1.2 * TEXT, Vec2::new(LEFT, 40.0), Rgb::INK, 0.0);
        let [x, y] = &self.axes;
        canvas.text(y, TEXT, Vec2::new(24.0, TOP - 18.0), Rgb::INK, 0.0);
        let end = side - RIGHT - text::width(x, TEXT);
        canvas.text(x, TEXT, Vec2::new(end, side - 24.0), Rgb::INK, 0.0);
        let mut pen = Vec2::new(LEFT, side - 24.0);
        for (kind, name) in self.kinds.iter().enumerate() {
            let name = text::fitted(name, TEXT, (end - LEFT) / self.kinds.len() as f32 - 60.0);
            draw_mark(canvas, pen + Vec2::new(MARK, -0.36 * TEXT), kind, Rgb::INK);
            canvas.text(&name, TEXT, pen + Vec2::new(28.0, 0.0), Rgb::INK, 0.0);
            pen.x += 60.0 + text::width(&name, TEXT);
        }
    }
}

/// Whole powers of ten around the positive values, at least one decade.
fn decades(values: impl Iterator<Item = f64>) -> [i32; 2] {
    let positive = values.filter(|&v| v > 0.0);
    let [low, high] =
        positive.fold([f64::INFINITY, 0.0], |[a, b]: [f64; 2], v| [a.min(v), b.max(v)]);
    if high == 0.0 {
        return [0, 1];
    }
    // Rounding makes tiny numbers of what is 0; twelve decades show all else.
    let high = high.log10().ceil() as i32;
    let low = (low.log10().floor() as i32).max(high - 12);
    [low, high.max(low + 1)]
}

/// Share of the axis below a value, within it.
fn share([low, high]: [i32; 2], value: f64) -> f32 {
    ((value.log10() - f64::from(low)) / f64::from(high - low)).clamp(0.0, 1.0) as f32
}

/// The decades of x and of y.
struct Axes([[i32; 2]; 2]);

impl Axes {
    fn x(&self, value: f64) -> f32 {
        LEFT + share(self.0[0], value) * (SIDE as f32 - LEFT - RIGHT)
    }

    fn y(&self, value: f64) -> f32 {
        SIDE as f32 - BOTTOM - share(self.0[1], value) * (SIDE as f32 - TOP - BOTTOM)
    }

    fn to_pixels(&self, at: DVec2) -> Vec2 {
        Vec2::new(self.x(at.x), self.y(at.y))
    }

    /// Lines across the plot at powers of ten, with their numbers.
    fn draw(&self, canvas: &mut Canvas) {
        let (right, bottom) = (SIDE as f32 - RIGHT, SIDE as f32 - BOTTOM);
        let size = 0.85 * TEXT;
        for power in shown_powers(self.0[0]) {
            let x = self.x(10f64.powi(power));
            let label = power_of_ten(power);
            let baseline = Vec2::new(x - 0.5 * text::width(&label, size), bottom + 30.0);
            canvas.lines(&[vec![Vec2::new(x, TOP), Vec2::new(x, bottom)]], 1.5, GRID, 1.0);
            canvas.text(&label, size, baseline, Rgb::INK, 0.0);
        }
        for power in shown_powers(self.0[1]) {
            let y = self.y(10f64.powi(power));
            let label = power_of_ten(power);
            let left = LEFT - 14.0 - text::width(&label, size);
            canvas.lines(&[vec![Vec2::new(LEFT, y), Vec2::new(right, y)]], 1.5, GRID, 1.0);
            canvas.text(&label, size, Vec2::new(left, y + 0.36 * size), Rgb::INK, 0.0);
        }
    }
}

/// Powers of ten that an axis names, a dozen at most.
fn shown_powers([low, high]: [i32; 2]) -> impl Iterator<Item = i32> {
    (low..=high).step_by(((high - low) / 6).max(1) as usize)
}

/// `10⁻³`.
fn power_of_ten(power: i32) -> String {
    "10".chars().chain(power.to_string().chars().map(superscript)).collect()
}

/// A digit or a minus sign raised.
fn superscript(c: char) -> char {
    match c {
        '-' => '⁻',
        '1' => '¹',
        '2' => '²',
        '3' => '³',
        digit => char::from_u32('⁰' as u32 + digit as u32 - '0' as u32).unwrap_or(digit),
    }
}

/// A disc, or a polygon with as many corners more as the kind says.
fn draw_mark(canvas: &mut Canvas, at: Vec2, kind: usize, colour: Rgb) {
    if kind == 0 {
        canvas.disc(at, MARK, 2.0, colour);
        return;
    }
    // Square, diamond, triangle up, triangle down.
    let (corners, turn) = [(4, 0.125), (4, 0.0), (3, 0.75), (3, 0.25)][(kind - 1) % 4];
    for (radius, colour) in [(MARK + 5.5, Rgb::WHITE), (MARK + 3.0, colour)] {
        let polygon = (0..corners).map(|i| {
            let angle = std::f32::consts::TAU * (turn + i as f32 / corners as f32);
            at + radius * Vec2::from_angle(angle)
        });
        canvas.polygon(&polygon.collect::<Vec<_>>(), colour);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_span_the_positive_values() {
        assert_eq!(decades([0.0, 0.02, 30.0].into_iter()), [-2, 2]);
        assert_eq!(decades([0.0].into_iter()), [0, 1]);
        assert_eq!(decades([10.0].into_iter()), [1, 2]);
        assert_eq!(decades([1e-30, 1.0].into_iter()), [-12, 0]);
        assert_eq!(power_of_ten(-13), "10⁻¹³");
        assert_eq!(share([0, 2], 10.0), 0.5);
        assert_eq!(share([0, 2], 0.0), 0.0);
    }

    #[test]
    fn every_mark_is_drawn() {
        let mut plot = LogPlot { kinds: vec!["a".into(), "b".into()], ..LogPlot::default() };
        let empty = plot.render().unwrap();
        for (kind, x) in [(0, 0.0), (1, 1.0), (2, 100.0)] {
            let at = DVec2::new(x, 7.0);
            plot.marks.push(Mark { at, colour: Rgb::ORANGE, kind, label: String::new() });
        }
        let full = plot.render().unwrap();
        let is_orange = |p: &image::Rgba<u8>| p[0] > 200 && p[2] < 50;
        assert!(full.pixels().filter(|p| is_orange(p)).count() > 500);
        assert!(!empty.pixels().any(is_orange));
        plot.marks[0].at.x = f64::NAN;
        assert!(plot.render().is_err());
    }
}
