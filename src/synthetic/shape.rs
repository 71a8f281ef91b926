//! What a kind of terrain is: its name and its formula.

use super::scalar::{Jet, Scalar};

/// A kind of terrain.
pub(super) struct Shape {
    /// Name on the command line.
    pub(super) name: &'static str,
    /// What it is, in a line for people.
    pub(super) description: &'static str,
    /// Default relief in units of `a`.
    pub(super) default_relief: f64,
    /// Whether it is part of a circle through the rim, `h` over or under it: no circle has a relief above `a`.
    pub(super) round: bool,
    /// The formula, metres in and metres out; the same function for numbers and for jets.
    pub(super) height: fn(&Parameters, f64, f64) -> f64,
    pub(super) jet: fn(&Parameters, Jet, Jet) -> Jet,
}

/// The numbers that a formula depends on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Parameters {
    /// `a`, half the longer side, in metres.
    pub(super) half_extent: f64,
    /// `h`, in metres.
    pub(super) relief: f64,
    /// Stream of the random numbers.
    pub(super) seed: u64,
    /// Octaves of noise that the grid can show.
    pub(super) octaves: u32,
}

impl Parameters {
    /// `(x, y)` in units of `a`.
    pub(super) fn unit<T: Scalar>(&self, x: T, y: T) -> (T, T) {
        (x * self.half_extent.recip(), y * self.half_extent.recip())
    }

    /// Signed curvature `1/R = 2h / (a² + h²)` of the circle through the rim and `h` below it.
    pub(super) fn arc_curvature(&self) -> f64 {
        let (a, h) = (self.half_extent, self.relief);
        2.0 * h / (a * a + h * h)
    }
}
