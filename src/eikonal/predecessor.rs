//! Where each value came from.

use glam::DVec2;
use rayon::prelude::*;

use super::factors::Factors;
use super::schedule::memory::MemoryStore;
use super::stencil::UNREACHED;
use super::stencil::foot::{self, Foot};
use super::stencil::ring::RING;
use super::tensor_field::TensorField;

/// Least value of a node over its ring, with the step to the point of the ring at which it is attained, see [`foot::best_foot`].
pub(super) fn best_foot(
    field: &TensorField,
    factors: &Factors,
    value: impl Fn(usize, usize) -> f32,
    col: usize,
    row: usize,
) -> Option<(f64, DVec2)> {
    if !field.is_open(col, row) {
        return None;
    }
    let ring = ring_values(field, value, col, row);
    let foot = foot::best_foot(ring, factors.terms(field, col, row), &field.steps(col, row))?;
    Some((foot.value, foot.step()))
}

/// The values on the ring of a node; infinite beyond the grid.
fn ring_values(
    field: &TensorField,
    value: impl Fn(usize, usize) -> f32,
    col: usize,
    row: usize,
) -> [f32; 8] {
    RING.map(|(i, j)| {
        let node = field.tiling.node(col as isize + i as isize, row as isize + j as isize);
        node.map_or(f32::INFINITY, |(c, r)| value(c, r))
    })
}

/// No place on the ring.
pub(super) const NOWHERE: u8 = u8::MAX;

/// The predecessor of each node, row-major, as a place on its [`RING`]: of the two ends of the segment that
/// its value came from, the one nearer to that point; the other, if only that is lower than the node. [`NOWHERE`]
/// where not reached. Where a factor applies both may be higher than the node; the nearer one still leads to the start.
pub(super) fn predecessors(field: &TensorField, factors: &Factors, store: &MemoryStore) -> Vec<u8> {
    let tiling = field.tiling;
    let mut predecessors = vec![NOWHERE; tiling.cols * tiling.rows];
    let value = |col: usize, row: usize| {
        let (tile, place) = tiling.locate(col, row);
        store.values.at(tile, place)
    };
    let rows = predecessors.par_chunks_mut(tiling.cols.max(1)).enumerate();
    rows.for_each(|(row, line)| {
        for (col, place) in line.iter_mut().enumerate() {
            let own = value(col, row);
            if own < UNREACHED {
                let ring = ring_values(field, value, col, row);
                let terms = factors.terms(field, col, row);
                let foot = foot::best_foot(ring, terms, &field.steps(col, row));
                *place = foot.map_or(NOWHERE, |foot| nearer_end(&foot, own, &ring));
            }
        }
    });
    predecessors
}

/// The end nearer to the foot of a node, unless only the other is lower than the node.
fn nearer_end(foot: &Foot, own: f32, ring: &[f32; 8]) -> u8 {
    let [a, b] = foot.ends;
    let (nearer, other) = if foot.theta > 0.5 { (b, a) } else { (a, b) };
    let is_end = foot.theta == 0.0 || foot.theta == 1.0;
    if !is_end && ring[nearer] >= own && ring[other] < own { other as u8 } else { nearer as u8 }
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
