//! An even slope.

use super::scalar::Scalar;
use super::shape::{Parameters, Shape};

pub(super) const PLANE: Shape = Shape {
    name: "plane",
    description: "even slope; distances known exactly",
    default_relief: 0.4,
    round: false,
    height: plane,
    jet: plane,
};

fn plane<T: Scalar>(p: &Parameters, x: T, y: T) -> T {
    let (u, v) = p.unit(x, y);
    (u * 0.6 + v * 0.8) * (0.5 * p.relief)
}
