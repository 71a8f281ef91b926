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
mod strip;
mod transport;
mod triangle;

use rayon::prelude::*;

use self::feet::{Feet, Input, Surroundings};
use self::strip::STRIP;
use self::transport::Ways;
use super::cone::Cones;
use super::field::{AREA, SIDE, TensorField};
use super::source::Seeds;
use super::update::{ROUNDING, UNREACHED, least};
use crate::{Control, Result};

/// The transport of the two rounds stands still when nothing changes by more than this many mean cells. What the first
/// leaves undone the second sees. In a prototype the first round left .3 to 7 % of the first-order error, the
/// second gained up to a factor of 6 at ratios of 100 and more, and further ones little.
const TOLERANCE_CELLS: [f32; 2] = [1e-4, 1e-5];

/// Brings first-order values to second order, nodes of the start excepted; estimates of the errors that are left.
pub(super) fn correct(
    field: &TensorField,
    cones: &Cones,
    values: &mut [[f32; AREA]],
    seeds: &[Option<Box<Seeds>>],
    control: &Control,
) -> Result<Vec<[f32; AREA]>> {
    let tiling = field.tiling;
    let keys: Vec<f32> = values.par_iter().map(least_of).collect();
    let mut order: Vec<u32> =
        (0..tiling.tiles() as u32).filter(|&t| keys[t as usize] < UNREACHED).collect();
    order.sort_unstable_by(|&a, &b| keys[a as usize].total_cmp(&keys[b as usize]).then(a.cmp(&b)));
    let mut feet = vec![Feet::NONE; tiling.tiles()];
    let mut reads = vec![0; tiling.tiles()];
    let mut round = |total: Option<&[[f32; AREA]]>, tolerance: f32| {
        let input = Input { field, cones, values, total, seeds };
        let rows = feet.par_chunks_mut(tiling.across).zip(reads.par_chunks_mut(tiling.across));
        rows.enumerate().try_for_each_init(
            Surroundings::default,
            |around, (row, (feet, reads))| {
                control.check()?;
                let strips = feet.chunks_mut(STRIP).zip(reads.chunks_mut(STRIP)).enumerate();
                for (k, (feet, reads)) in strips {
                    around.find(&input, row * tiling.across + k * STRIP, feet, reads);
                }
                Ok(())
            },
        )?;
        let ways = Ways { feet: &feet, reads: &reads, keys: &keys, order: &order };
        transport::carry(field, &ways, tolerance * field.mean_step, control)
    };
    control.report("correcting distance", 0.0);
    let first = round(None, TOLERANCE_CELLS[0])?;
    control.report("correcting distance", 0.5);
    let mut second = round(Some(&first), TOLERANCE_CELLS[1])?;
    control.report("correcting distance", 1.0);
    values.par_iter_mut().zip(&first).zip(&mut second).for_each(|((values, first), second)| {
        for i in 0..AREA {
            let total = first[i] + second[i];
            (values[i], second[i]) = (values[i] + total, error_left(values[i], total, second[i]));
        }
    });
    Ok(second)
}

/// The least value of a tile.
fn least_of(tile: &[f32; AREA]) -> f32 {
    let mut lowest = [f32::INFINITY; SIDE];
    for row in tile.as_chunks::<SIDE>().0 {
        for i in 0..SIDE {
            lowest[i] = least(row[i], lowest[i]);
        }
    }
    lowest.into_iter().fold(f32::INFINITY, f32::min)
}

/// What may be wrong with a corrected value: the last round's change, the share of the correction that is typically
/// left after it, and rounding.
fn error_left(value: f32, total: f32, last: f32) -> f32 {
    const SHARE_LEFT: f32 = 0.1;
    last.abs() + SHARE_LEFT * total.abs() + ROUNDING * value
}
