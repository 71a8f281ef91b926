//! Second order by deferred correction.
//!
//! The first-order distance `g` tells where each node's value comes from: a point between two neighbours `a` and `b`, its
//! foot. There a functional of second order is evaluated,
//!
//! ```text
//!   F(θ) = (1−θ) w(a) + θ w(b) + g0(x + v) + C(θ) − θ(1−θ) S/2,     v = (1−θ)(a−x) + θ(b−x),
//!   C(θ) = ½ (‖v‖_x + (1−θ) ‖v‖_a + θ ‖v‖_b),
//! ```
//!
//! with the metric by the trapezoidal rule along the step, `w = g − g0` curved between the two by its limited
//! second difference `S`, and the cone `g0` (see [`mod@super::cone`]) exact. What the functional says more than
//! the value itself, `ρ = F − g`, travels with the front: the correction solves the linear equation
//!
//! ```text
//!   e(x) = (1−θ) e(a) + θ e(b) + ρ(x).
//! ```
//!
//! Feet are frozen, so there is nothing that could oscillate: `e` is a sum of `ρ` along feet, and `|S/8| ≤ C/2`. A foot is
//! the least point of its functional, so that an error in it counts only squared. A second round with `g + e` brings
//! most of what is left.

mod feet;
mod functional;
mod patch;
mod transport;

use rayon::prelude::*;

use self::feet::{Feet, Finder, Input};
use super::cone::Cones;
use super::field::{AREA, TensorField};
use super::source::Seeds;
use super::update::ROUNDING;
use crate::{Control, Result};

/// Rounds of correction. In a prototype the first left .3 to 7 % of the first-order error, the second gained up to a factor
/// of 6 at ratios of 100 and more, and further ones little.
const ROUNDS: usize = 2;
/// The transport of a round stands still when nothing changes by more than this many mean cells. What the first leaves
/// undone the second sees.
const TOLERANCE_CELLS: [f32; ROUNDS] = [1e-4, 1e-5];

/// Corrections of the nodes of each tile, and estimates of the error that is left.
pub(super) struct Correction {
    pub(super) values: Vec<[f32; AREA]>,
    pub(super) errors: Vec<[f32; AREA]>,
}

/// Corrects first-order values; nodes of the start keep theirs.
pub(super) fn correct(
    field: &TensorField,
    cones: &Cones,
    values: &[[f32; AREA]],
    seeds: &[Option<Box<Seeds>>],
    control: &Control,
) -> Result<Correction> {
    let tiles = field.tiling.tiles();
    let mut total = vec![[0f32; AREA]; tiles];
    let mut last = Vec::new();
    let mut feet = vec![Feet::NONE; tiles];
    for tolerance in TOLERANCE_CELLS {
        let input = Input { field, cones, values, total: &total, seeds };
        feet.par_iter_mut().enumerate().try_for_each_init(
            Finder::default,
            |bench, (tile, feet)| {
                control.check()?;
                bench.find(&input, tile, feet);
                Ok(())
            },
        )?;
        last = transport::carry(field, values, &feet, tolerance * field.mean_step, control)?;
        total.par_iter_mut().zip(&last).for_each(|(total, last)| {
            total.iter_mut().zip(last).for_each(|(total, last)| *total += last);
        });
    }
    let errors = total.par_iter().zip(&last).zip(values).map(|((total, last), values)| {
        std::array::from_fn(|i| error_left(values[i], total[i], last[i]))
    });
    let errors = errors.collect();
    Ok(Correction { values: total, errors })
}

/// What may be wrong with a corrected value: the last round's change, the share of the correction that is typically
/// left after it, and rounding.
fn error_left(value: f32, total: f32, last: f32) -> f32 {
    const SHARE_LEFT: f32 = 0.1;
    last.abs() + SHARE_LEFT * total.abs() + ROUNDING * value
}
