//! Long ridges and valleys.

use std::f64::consts::TAU;

use super::noise::{gradient_noise, hash, ridged};
use super::scalar::Scalar;
use super::shape::{Parameters, Shape};

pub(super) const RANGE: Shape = Shape {
    name: "range",
    description: "long ridges and valleys with passes and spurs (seeded)",
    default_relief: 0.25,
    round: false,
    height: range,
    jet: range,
};

fn range<T: Scalar>(p: &Parameters, x: T, y: T) -> T {
    let (u, v) = p.unit(x, y);
    // The factor makes the usual range of heights about 1.
    ridges(p.seed, p.octaves, u, v) * (0.75 * p.relief)
}

/// Waves across the strike N 37° E, bent by slow noise; crests and valley floors rise and sink along
/// the strike, and ridged noise that fades towards the valley floors carves the spurs.
fn ridges<T: Scalar>(seed: u64, octaves: u32, u: T, v: T) -> T {
    /// Ridges per unit of `a`.
    const FREQUENCY: f64 = 1.6;
    let bend = gradient_noise(hash(seed, 1), u * 1.3, v * 1.3) * 0.35;
    let across = u * 0.8 - v * 0.6 + bend;
    let wave = (across * (TAU * FREQUENCY)).cos() * 0.5 + 0.5;
    let crest = gradient_noise(hash(seed, 2), u * 2.6, v * 2.6) * 0.9 + 0.6;
    let spurs = ridged(hash(seed, 3), octaves, u * 2.0, v * 2.0);
    wave * crest + (wave * 0.85 + 0.15) * spurs * 0.25
}
