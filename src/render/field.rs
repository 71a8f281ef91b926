//! A field in colour, such as distance, slope or curvature, with a colour bar.

use glam::DVec2;
use image::RgbaImage;

use super::gradient::Gradient;
use super::layout::{MapLayout, SIDE};
use super::legend::Entry;
use super::png::encode_png;
use super::text::number;
use crate::control::Control;
use crate::error::{Error, Result};
use crate::grid::{GridFrame, round_step};

/// Colours along the bar.
const SHADES: usize = 256;

/// What a picture of a field shows.
#[derive(Clone, Debug)]
pub struct FieldPicture<'a> {
    /// The grid.
    pub frame: &'a GridFrame,
    /// The values, row-major; `NaN` or infinite where there is none.
    pub values: &'a [f32],
    /// How values become colours.
    pub gradient: Gradient,
    /// What the values are, with their unit: `slope (°)`.
    pub label: String,
    /// The line above the map; empty for none.
    pub title: String,
    /// Pixels of the map's longer side, 100 to 8192. Default: 1600.
    pub max_side_px: u32,
    /// Asked whether to cancel while the ground is painted.
    pub control: Control,
}

impl<'a> FieldPicture<'a> {
    /// A picture of `values` named `label`.
    #[must_use]
    pub fn new(
        frame: &'a GridFrame,
        values: &'a [f32],
        gradient: Gradient,
        label: impl Into<String>,
    ) -> Self {
        Self {
            frame,
            values,
            gradient,
            label: label.into(),
            title: String::new(),
            max_side_px: SIDE,
            control: Control::default(),
        }
    }

    /// Draws the picture.
    ///
    /// # Errors
    /// [`Error::Argument`] if there is not one value per node or the size is out of bounds; cancelled.
    pub fn render(&self) -> Result<RgbaImage> {
        if self.values.len() != self.frame.nodes() {
            return Err(Error::argument(
                "the number of values",
                self.values.len(),
                format!("{}, that of the nodes", self.frame.nodes()),
            ));
        }
        let range = self.gradient.range(self.values);
        let mut legend = Vec::new();
        if let Some([low, high]) = range {
            legend.push(Entry::Bar {
                colours: (0..SHADES)
                    .map(|i| self.gradient.colour(i as f64 / (SHADES - 1) as f64))
                    .collect(),
                ticks: ticks(low, high),
                label: self.label.clone(),
            });
        }
        if self.values.iter().any(|v| !v.is_finite()) {
            legend.push(Entry::Patch { colour: None, label: "no value".into() });
        }
        let mut layout = MapLayout::new(self.frame, &self.title, self.max_side_px, legend)?;
        layout.ground(&self.control, |grid| {
            let [low, high] = range?;
            let share = (self.value(grid)? - low) / (high - low);
            Some(self.gradient.colour(share))
        })?;
        Ok(layout.finish())
    }

    /// [`render`](Self::render) as a PNG file.
    ///
    /// # Errors
    /// As [`render`](Self::render).
    pub fn png(&self) -> Result<Vec<u8>> {
        encode_png(&self.render()?)
    }

    /// The value at grid coordinates: that of the nearest node (a field may be discontinuous).
    fn value(&self, grid: DVec2) -> Option<f64> {
        let node = self.frame.clamp(grid).round();
        let value = self.values[self.frame.index(node.x as usize, node.y as usize)];
        value.is_finite().then_some(f64::from(value))
    }
}

/// Round numbers between `low` and `high`, and their shares of the way.
fn ticks(low: f64, high: f64) -> Vec<(f64, String)> {
    let step = round_step(high - low, 6);
    // An end that all but reaches a round number shows it: distances begin just above 0.
    let near = 0.01 * (high - low);
    let first = ((low - near) / step).ceil();
    (0..=6)
        .map(|i| (first + f64::from(i)) * step)
        .take_while(|v| *v <= high + near)
        .map(|v| (((v - low) / (high - low)).clamp(0.0, 1.0), number(v)))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grid::Ground;
    use crate::render::colour::Rgb;

    #[test]
    fn colours_run_from_end_to_end() {
        let frame = GridFrame::new(3, 1, DVec2::ZERO, DVec2::ONE, Ground::METRES).unwrap();
        let values = [0.0, 50.0, f32::NAN];
        let field = FieldPicture::new(&frame, &values, Gradient::Sequential, "d (m)");
        assert_eq!(field.gradient.range(&values), Some([0.0, 50.0]));
        assert_eq!(field.gradient.colour(0.0), Rgb(68, 1, 84));
        assert!(field.value(DVec2::new(1.4, 0.2)) == Some(50.0));
        assert!(field.value(DVec2::new(1.6, 0.0)).is_none());
        field.png().unwrap();
    }

    #[test]
    fn diverging_ranges_are_symmetric_and_robust() {
        let frame = GridFrame::new(100, 1, DVec2::ZERO, DVec2::ONE, Ground::METRES).unwrap();
        let mut values = vec![-2.0; 100];
        values[0] = 1e6;
        let field = FieldPicture::new(&frame, &values, Gradient::Diverging, "K");
        assert_eq!(field.gradient.range(&values), Some([-2.0, 2.0]));
    }

    #[test]
    fn ticks_are_round_and_inside() {
        let shown: Vec<_> = ticks(-0.3, 1.0).into_iter().map(|t| t.1).collect();
        assert_eq!(shown, ["0", "0.5", "1"]);
        assert_eq!(ticks(0.001, 1.0)[0], (0.0, "0".into()));
        assert!(ticks(0.0, 1.0).iter().all(|t| (0.0..=1.0).contains(&t.0)));
    }

    #[test]
    fn empty_and_constant_fields_make_pictures() {
        let frame = GridFrame::new(4, 4, DVec2::ZERO, DVec2::ONE, Ground::METRES).unwrap();
        for value in [f32::NAN, 7.0] {
            let values = [value; 16];
            FieldPicture::new(&frame, &values, Gradient::Sequential, "x").render().unwrap();
            FieldPicture::new(&frame, &values, Gradient::Diverging, "x").render().unwrap();
        }
    }
}
