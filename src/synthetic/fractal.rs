//! Mountains at every scale.

use super::noise::{gradient_noise, hash, ridged};
use super::scalar::Scalar;
use super::shape::{Parameters, Shape};

pub(super) const FRACTAL: Shape = Shape {
    name: "fractal",
    description: "mountains with detail at every scale (seeded)",
    default_relief: 0.35,
    round: false,
    height: fractal,
    jet: fractal,
};

fn fractal<T: Scalar>(p: &Parameters, x: T, y: T) -> T {
    let (u, v) = p.unit(x, y);
    // The factor makes the usual range of heights about 1.
    mountains(p.seed, p.octaves, u, v) * (0.6 * p.relief)
}

/// Ridged noise, tall where slow noise is high and bent by it, so that massifs alternate with basins.
fn mountains<T: Scalar>(seed: u64, octaves: u32, u: T, v: T) -> T {
    let [high, east, north] =
        [1, 2, 3].map(|stream| gradient_noise(hash(seed, stream), u * 1.1 + 0.3, v * 1.1 + 0.6));
    let ridges = ridged(hash(seed, 4), octaves, u * 1.5 + east * 0.6, v * 1.5 + north * 0.6);
    ridges * (high * 0.7 + 0.6) + high * 0.4
}
