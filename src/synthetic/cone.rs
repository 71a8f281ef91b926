//! A sharp tip.

use super::scalar::Scalar;
use super::shape::{Parameters, Shape};

pub(super) const CONE: Shape = Shape {
    name: "cone",
    description: "cone with a sharp tip",
    default_relief: 0.5,
    round: false,
    height: cone,
    jet: cone,
};

fn cone<T: Scalar>(p: &Parameters, x: T, y: T) -> T {
    let (u, v) = p.unit(x, y);
    -(u * u + v * v).sqrt() * p.relief + p.relief
}
