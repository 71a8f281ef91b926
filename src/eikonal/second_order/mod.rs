//! Second order by deferred correction.
//!
//! The first-order distance `g` shows where each node's value comes from: a point between two neighbours `a` and `b`, its
//! foot. There a functional of second order is evaluated,
//!
//! ```text
//!   F(θ) = (1−θ) w(a) + θ w(b) + g0(x + v) + C(θ) − θ(1−θ) S/2,     v = (1−θ)(a−x) + θ(b−x),
//!   C(θ) = ½ (‖v‖_x + (1−θ) ‖v‖_a + θ ‖v‖_b),
//! ```
//!
//! with the metric by the trapezoidal rule along the step, `w = g − g0` curved between the two by its limited
//! second difference `S`, and the source factor `g0` (see [`mod@super::stencil::factoring`]) exact. The defect `ρ = F − g`, by
//! which the functional exceeds the value itself, travels with the front: the correction solves the linear equation
//!
//! ```text
//!   e(x) = (1−θ) e(a) + θ e(b) + ρ(x).
//! ```
//!
//! Where steps are priced by cells, the metric along the step is that at its middle instead, linear between the middles of the two cells beside
//! the edge to `a`, times the mean of the costs at both ends, and with the climb along it. Where the metric or the costs turn or jump
//! within a cell, such a functional means nothing: there the defect is put aside, and the value stays of first order.
//!
//! Feet are frozen, so that nothing can oscillate: `e` is a sum of `ρ` along feet, and `|S/8| ≤ C/2`. A foot is
//! the minimum point of its functional, so that an error in it counts only squared. A second round with `g + e` in place of `g`
//! removes most of the error that is left.

mod domain;
mod feet;
mod first_order;
mod functional;
mod halo;
mod transport;
mod triangle;

use rayon::prelude::*;

use self::domain::Domain;
use self::feet::Roughness;
pub(super) use self::first_order::FirstOrder;
use self::transport::carry;
use super::tile::changes::ROUNDING;
use crate::control::Control;
use crate::error::Result;
use crate::grid::tiling::AREA;
use crate::linalg::lanes::greatest;

/// The transport of each of the two rounds has converged when nothing changes by more than this many mean cells. What the first
/// leaves, the second corrects. In a prototype the first round left .3 to 7 % of the first-order error, the
/// second gained up to a factor of 6 at ratios of 100 and more, and further ones little.
const TOLERANCE_CELLS: [f32; 2] = [1e-4, 1e-5];

/// What brings first-order values to second order; zero at nodes of the start.
#[derive(Clone, Debug)]
pub(super) struct Correction {
    /// The sum of both rounds.
    total: Vec<[f32; AREA]>,
    /// That of the first round.
    first: Vec<[f32; AREA]>,
    /// Nodes that were left at first order.
    rough_nodes: u32,
    /// The defects put aside there as a share of the length of all steps.
    roughness: f32,
}

impl Correction {
    pub(super) fn new(solution: &FirstOrder<'_>, control: &Control) -> Result<Self> {
        let tiles = solution.field.tiling.tiles();
        let nothing = || vec![[0.0; AREA]; tiles];
        let domain = Domain::around(solution, &vec![true; tiles]);
        Self::in_two_rounds(domain, nothing(), nothing(), control)
    }

    /// The correction after an edit in these tiles, from that before. What is not downstream of them stays.
    pub(super) fn update(
        self,
        solution: &FirstOrder<'_>,
        changed: &[bool],
        control: &Control,
    ) -> Result<Self> {
        let Self { total: mut second, mut first, .. } = self;
        let rounds = second.par_iter_mut().zip(&mut first);
        rounds.enumerate().for_each(|(tile, (second, first))| {
            for i in 0..AREA {
                second[i] -= first[i];
            }
            if changed[tile] {
                for i in solution.fixed(tile) {
                    (first[i], second[i]) = (0.0, 0.0);
                }
            }
        });
        Self::in_two_rounds(Domain::around(solution, changed), first, second, control)
    }

    /// Corrects the domain, and what the correction is carried to, starting from the rounds before the edit.
    fn in_two_rounds(
        mut domain: Domain<'_>,
        first: Vec<[f32; AREA]>,
        second: Vec<[f32; AREA]>,
        control: &Control,
    ) -> Result<Self> {
        control.report("correcting distance", 0.0);
        let first = round(&mut domain, first, None, TOLERANCE_CELLS[0], control)?;
        control.report("correcting distance", 0.5);
        domain.widen();
        let mut total = round(&mut domain, second, Some(&first), TOLERANCE_CELLS[1], control)?;
        let Roughness { nodes, rejected, lengths } = domain.roughness();
        control.report("correcting distance", 1.0);
        let values = domain.solution.values;
        total.par_iter_mut().zip(&first).enumerate().for_each(|(tile, (total, first))| {
            let values = &values.tile(tile)[..AREA];
            for i in 0..AREA {
                // Not below −g: no distance is to be negative, also where the field is so rough that the transport does not converge.
                total[i] = greatest(total[i] + first[i], -values[i]);
            }
        });
        let roughness = if lengths > 0.0 { rejected / lengths } else { 0.0 };
        Ok(Self { total, first, rough_nodes: nodes, roughness })
    }

    /// How many nodes were left at first order: where the metric or the costs turn or jump within a cell.
    pub(super) fn rough_nodes(&self) -> u32 {
        self.rough_nodes
    }

    /// How much is to be added to the value at a place of a tile.
    pub(super) fn at(&self, tile: usize, place: usize) -> f32 {
        self.total[tile][place]
    }

    /// Estimate of the error of a corrected value: the change by the last round, the share of the correction that typically
    /// remains as error after it, a part of what was put aside on the way, and rounding.
    pub(super) fn error_left(&self, tile: usize, place: usize, value: f32) -> f32 {
        const SHARE_LEFT: f32 = 0.1;
        /// On real ground defects that were put aside are several times as large as the error that is left.
        const ROUGH_SHARE: f32 = 0.25;
        let (total, first) = (self.total[tile][place], self.first[tile][place]);
        let rough = ROUGH_SHARE * self.roughness * value;
        (total - first).abs() + SHARE_LEFT * total.abs() + rough + ROUNDING * value
    }
}

/// A round of correction in a domain, starting from the correction `e` of the same round before the edit. `total` is the sum of the
/// earlier rounds, `None` in the first. The domain grows by what the correction is carried to.
fn round(
    domain: &mut Domain<'_>,
    mut e: Vec<[f32; AREA]>,
    total: Option<&[[f32; AREA]]>,
    tolerance_cells: f32,
    control: &Control,
) -> Result<Vec<[f32; AREA]>> {
    let tolerance = tolerance_cells * domain.solution.field.mean_step;
    loop {
        let order = domain.find(total, control)?;
        let (carried, beyond) = carry(domain, &order, e, tolerance, control)?;
        if beyond.is_empty() {
            return Ok(carried);
        }
        e = carried;
        beyond.into_iter().for_each(|tile| domain.add(tile));
    }
}
