//! A plain under craters.

use super::noise::{gradient_noise, hash, uniform_pair};
use super::scalar::Scalar;
use super::shape::{Parameters, Shape};

pub(super) const CRATERS: Shape = Shape {
    name: "craters",
    description: "plain under craters of many sizes (seeded)",
    default_relief: 0.2,
    round: false,
    height: craters,
    jet: craters,
};

fn craters<T: Scalar>(p: &Parameters, x: T, y: T) -> T {
    let (u, v) = p.unit(x, y);
    // The factor makes the usual range of heights about 1.
    bowls(p.seed, u, v) * (0.5 * p.relief)
}

/// Craters with radii between 0.04 and 0.35, as many larger than `r` as `1/r²`, on a rolling plain.
///
/// Each adds `(q − 0.8) exp(−q) · depth`, `q` the squared distance in radii: a bowl and a rim a fifth as high.
fn bowls<T: Scalar>(seed: u64, u: T, v: T) -> T {
    const COUNT: u64 = 70;
    const RADII: (f64, f64) = (0.04, 0.35);
    let plain = gradient_noise(hash(seed, 0), u * 2.0, v * 2.0) * 0.3;
    (1..=COUNT).fold(plain, |sum, index| {
        let [east, north] = uniform_pair(hash(seed, 2 * index)).map(|t| 2.2 * t - 1.1);
        let [quantile, _] = uniform_pair(hash(seed, 2 * index + 1));
        let radius = (RADII.0 / (1.0 - quantile).sqrt()).min(RADII.1);
        let (u, v) = (u - east, v - north);
        let q = (u * u + v * v) * (radius * radius).recip();
        sum + (q - 0.8) * (-q).exp() * (4.0 * radius)
    })
}
