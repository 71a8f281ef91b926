//! Round hills.

use super::scalar::Scalar;
use super::shape::{Parameters, Shape};

pub(super) const BUMPS: Shape = Shape {
    name: "bumps",
    description: "five round hills of different size",
    default_relief: 0.3,
    round: false,
    height: bumps,
    jet: bumps,
};

pub(super) const FOUR_BUMPS: Shape = Shape {
    name: "four-bumps",
    description: "four equal hills that meet",
    default_relief: 0.4,
    round: false,
    height: four_bumps,
    jet: four_bumps,
};

fn bumps<T: Scalar>(p: &Parameters, x: T, y: T) -> T {
    let (u, v) = p.unit(x, y);
    hills(&FIVE_HILLS, u, v) * p.relief
}

fn four_bumps<T: Scalar>(p: &Parameters, x: T, y: T) -> T {
    let (u, v) = p.unit(x, y);
    four_hills(u, v) * p.relief
}

/// Gaussian hills `(east, north, height, standard deviation)`; lengths in units of `a`.
type Hill = (f64, f64, f64, f64);

const FIVE_HILLS: [Hill; 5] = [
    (-0.44, -0.40, 0.8, 0.18),
    (0.40, -0.48, 8.0 / 15.0, 0.24),
    (0.24, 0.36, 1.0, 0.22),
    (-0.52, 0.48, 0.4, 0.30),
    (-0.06, -0.12, 1.0 / 3.0, 0.12),
];

fn hills<T: Scalar>(hills: &[Hill], u: T, v: T) -> T {
    hills.iter().fold(u * 0.0, |sum, &(east, north, height, deviation)| {
        let (u, v) = (u - east, v - north);
        sum + ((u * u + v * v) * (-0.5 / (deviation * deviation))).exp() * height
    })
}

/// Hills in the four quarters, flat at the top, that meet on the axes.
fn four_hills<T: Scalar>(u: T, v: T) -> T {
    const AWAY: f64 = 2.0 / 3.0;
    const WIDTH: f64 = 0.64;
    [(-AWAY, -AWAY), (AWAY, -AWAY), (-AWAY, AWAY), (AWAY, AWAY)].into_iter().fold(
        u * 0.0,
        |sum, (east, north)| {
            let (u, v) = (u - east, v - north);
            let q = (u * u + v * v) * (WIDTH * WIDTH).recip();
            sum + (q * q * -1.0).exp()
        },
    )
}
