//! A mountainside with a zigzag.

use std::f64::consts::PI;

use super::scalar::Scalar;
use super::shape::{Parameters, Shape};

pub(super) const SWITCHBACKS: Shape = Shape {
    name: "switchbacks",
    description: "steep mountainside with a zigzag of benches",
    default_relief: 1.0,
    round: false,
    height: switchbacks,
    jet: switchbacks,
};

fn switchbacks<T: Scalar>(p: &Parameters, x: T, y: T) -> T {
    let (u, v) = p.unit(x, y);
    zigzag(u, v) * p.relief
}

/// Height 0 to 1 from south to north. With `t` that height and the phase `φ = 5πt`, benches lie at
/// `sin φ = ±1`, where `sin 2φ / …` takes out most of the slope; the last term tilts them eastwards and
/// westwards in turn, so that each nearly meets the next at its upper end.
fn zigzag<T: Scalar>(u: T, v: T) -> T {
    const BENCHES: f64 = 5.0;
    /// Part of the slope that a bench loses.
    const FLATNESS: f64 = 0.85;
    /// Rise of a bench from the middle to the border, in bench intervals; at 0.5 it meets the next.
    const TILT: f64 = 0.42;
    let t = v * 0.5 + 0.5;
    let phase = t * (PI * BENCHES);
    t + (phase * 2.0).sin() * (0.5 * FLATNESS / (PI * BENCHES)) + u * phase.sin() * (TILT / BENCHES)
}
