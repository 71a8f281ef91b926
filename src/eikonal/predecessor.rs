//! Where each value came from.

#![allow(clippy::needless_range_loop, reason = "lanes of several arrays go together")]

use glam::DVec2;
use rayon::prelude::*;

use super::factors::Factors;
use super::schedule::memory::MemoryStore;
use super::stencil::UNREACHED;
use super::stencil::foot;
use super::stencil::ring::{RING, for_each_triangle, ring_of, rings, without_cut_corners};
use super::tensor_field::TensorField;
use super::tile::coefficients::{Coefficients, LaneLimits, factoring_terms, line_tensors};
use super::tile::{Block, Tile};
use crate::grid::tiling::SIDE;
use crate::linalg::lanes::{lanes, least};
use crate::linalg::simd::{self, Kernel};

/// Least value of a node over its ring, with the step to the point of the ring at which it is attained, see [`foot::best_foot`].
pub(super) fn best_foot(
    field: &TensorField,
    factors: &Factors,
    value: impl Fn(usize, usize) -> f32,
    col: usize,
    row: usize,
) -> Option<(f64, DVec2)> {
    let metric = field.metric(col, row)?;
    let ring = RING.map(|(i, j)| {
        let node = field.tiling.node(col as isize + i as isize, row as isize + j as isize);
        node.map_or(f32::INFINITY, |(c, r)| value(c, r))
    });
    foot::best_foot(ring, factors.terms(field, col, row), metric)
}

/// No place on the ring.
pub(super) const NOWHERE: u8 = u8::MAX;

/// The predecessor of each node, row-major, as a place on its [`RING`]: of the two ends of the segment that
/// its value came from, the one nearer to that point; the other, if only that is lower than the node. [`NOWHERE`]
/// where not reached. Where a factor applies both may be higher than the node; the nearer one still leads to the start.
pub(super) fn predecessors(field: &TensorField, factors: &Factors, store: &MemoryStore) -> Vec<u8> {
    let tiling = field.tiling;
    let mut predecessors = vec![NOWHERE; tiling.cols * tiling.rows];
    let bands = predecessors.par_chunks_mut((tiling.cols * SIDE).max(1)).enumerate();
    bands.for_each_init(Block::default, |block, (y, band)| {
        for x in 0..tiling.across {
            let index = y * tiling.across + x;
            let factor = factors.of_tile(index).map(|factor| (factor, tiling.first(index)));
            let tile = Tile { tensors: field.tensors(index), factor, tolerance: 0.0, seeds: None };
            store.values.read(index, block);
            let [cols, _] = tiling.size(index);
            let found = simd::dispatch(TilePredecessors { block, tile: &tile });
            for (line, found) in band.chunks_mut(tiling.cols).zip(found) {
                line[x * SIDE..][..cols].copy_from_slice(&found[..cols]);
            }
        }
    });
    predecessors
}

/// Finds the predecessors of the nodes of a tile.
struct TilePredecessors<'a> {
    block: &'a Block,
    tile: &'a Tile<'a>,
}

impl Kernel for TilePredecessors<'_> {
    type Output = [[u8; SIDE]; SIDE];

    #[inline(always)]
    fn run(self) -> Self::Output {
        let mut predecessors = [[NOWHERE; SIDE]; SIDE];
        for row in 0..SIDE {
            let line = line_predecessors(self.block, self.tile, row);
            for i in 0..SIDE {
                predecessors[row][i] = line[i] as u8;
            }
        }
        predecessors
    }
}

/// The predecessors of the nodes of a row of a tile.
#[inline(always)]
fn line_predecessors(block: &Block, tile: &Tile<'_>, row: usize) -> [u32; SIDE] {
    let (mut k, mut limits) = (Coefficients::CLOSED, LaneLimits::default());
    let tensors = line_tensors(tile, row, false);
    k.prepare(tile, row, false, &tensors, &mut limits);
    let mut terms = [[0f32; SIDE]; 8];
    factoring_terms(tile, row, false, &tensors, &mut terms, &mut limits);
    let [xxs, xys, dets] = tensors;
    let rings = rings([&block[row], &block[row + 1], &block[row + 2]], 1);
    let own = lanes(&block[row + 1], 1);
    let mut predecessors = [u32::from(NOWHERE); SIDE];
    for i in 0..SIDE {
        let ring = without_cut_corners(ring_of(&rings, i));
        let mut g = ring;
        for k in 0..8 {
            g[k] += terms[k][i];
        }
        let mut best = Best { value: UNREACHED, place: u32::from(NOWHERE) };
        for place in 0..8 {
            let through = g[place] + k.step[place % 4][i];
            best.offer(through, place as u32);
        }
        let (xx, xy, det) = (xxs[i], xys[i], dets[i]);
        let yy = (det + xy * xy) / xx;
        for_each_triangle!(t => {
            let (a, b) = (t.a, t.b);
            let through = k.closed_form(t, i).through(g[a], g[b]);
            let (s, q) = if t.along_y { (yy, xx) } else { (xx, yy) };
            let is_near_b =
                g[b] - g[a] < middle_slope_limit(s, q, if t.falling { -xy } else { xy }, det);
            let (a_lower, b_lower) = (ring[a] < own[i], ring[b] < own[i]);
            let to_b = (is_near_b & (b_lower | !a_lower)) | (b_lower & !a_lower);
            let to = if to_b { b as u32 } else { a as u32 };
            best.offer(through, to);
        });
        predecessors[i] = if own[i] < UNREACHED { best.place } else { u32::from(NOWHERE) };
    }
    predecessors
}

/// The best value so far and the place on the ring that it leads to.
struct Best {
    value: f32,
    place: u32,
}

impl Best {
    #[inline(always)]
    fn offer(&mut self, value: f32, place: u32) {
        self.place = if value < self.value { place } else { self.place };
        self.value = least(value, self.value);
    }
}

/// `−mᵀMw/‖m‖` at the middle `m` of a segment, with `D = [s β; β q]` as in
/// [`ClosedForm`](super::stencil::segment::ClosedForm). Where `d = gb − ga` is less, the sum still falls at the middle, and its minimum is
/// nearer to `b`.
#[inline(always)]
fn middle_slope_limit(s: f32, q: f32, beta: f32, det: f32) -> f32 {
    (beta - 0.5 * s) / ((q - beta + 0.25 * s) * det).sqrt()
}

#[cfg(test)]
mod tests {
    use glam::DVec2;

    use super::super::stencil::ring::RING;
    use super::*;
    use crate::control::Control;
    use crate::eikonal::{Solver, Stop};
    use crate::linalg::Sym2;

    #[test]
    fn predecessors_are_the_ends_nearest_to_the_feet() {
        let tensor = |col: usize, row: usize| {
            let (sin, cos) = (0.1 * col as f64 + 0.07 * row as f64).sin_cos();
            let along = Sym2::new(cos * cos, sin * cos, sin * sin);
            (!(col * 7 + row * 13).is_multiple_of(29))
                .then(|| along * 0.9 + Sym2::new(0.1, 0.0, 0.1))
        };
        for periodic in [[false, false], [true, false]] {
            let control = Control::default();
            let field = TensorField::from_fn(50, 40, tensor, &control).unwrap();
            let field = field.periodic(periodic).unwrap();
            let start = DVec2::new(20.3, 17.6).into();
            let map = Solver::default().solve_field(field, &[start], &Stop::Never, &control);
            let map = map.unwrap();
            let (mut reached, mut nearest) = (0, 0);
            for (node, predecessor) in
                predecessors(&map.field, &map.factors, &map.corrected()).into_iter().enumerate()
            {
                let (col, row) = (node % map.cols(), node / map.cols());
                if !map.is_reached(col, row) {
                    assert_eq!(predecessor, NOWHERE);
                    continue;
                }
                let (_, foot) = map.best_foot(col, row).unwrap();
                let (i, j) = RING[usize::from(predecessor)];
                let away = (DVec2::new(i.into(), j.into()) - foot).abs().max_element();
                assert!(away <= 1.0, "({col}, {row}): {predecessor}, {foot}");
                reached += 1;
                nearest += usize::from(away <= 0.501);
            }
            // Of the rest only the other end is lower than the node.
            assert!(reached > 1800 && nearest * 20 > reached * 19, "{nearest} of {reached}");
        }
    }
}
