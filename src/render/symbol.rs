//! Symbols that stand on maps and in their legends.

use glam::Vec2;

use super::canvas::Canvas;
use super::colour::Rgb;
use super::relief::VOID;
use super::text;

/// The colour of ground that is not known, hatched along the diagonals `x + y`.
pub(super) fn hatching(diagonal: usize, period: usize) -> Rgb {
    VOID[usize::from(diagonal % period.max(2) < period.div_ceil(6))]
}

/// A disc with a letter or a number.
pub(super) fn draw_pin(canvas: &mut Canvas, at: Vec2, mark: &str, colour: Rgb, unit: f32) {
    canvas.disc(at, 14.0 * unit, 3.0 * unit, colour);
    // Long numbers are set smaller.
    let size = 20.0 * unit * (22.0 / text::width(mark, 20.0)).min(1.0);
    // Half of DejaVu's capital height, 0.729 em, centres the mark.
    let baseline = at + Vec2::new(-text::width(mark, size) / 2.0, 0.365 * size);
    canvas.text(mark, size, baseline, Rgb::WHITE, 0.0);
}
