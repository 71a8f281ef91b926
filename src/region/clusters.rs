//! Clusters that cover a grid.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use glam::DVec2;
use rayon::prelude::*;

use crate::eikonal::TensorField;
use crate::metric::Difference;
use crate::{Control, DistanceMap, Error, ParametricSurface, Result, Solver, Stop};

/// Most clusters of a cover: beyond this `ε` is surely a mistake.
const MOST: usize = 1 << 16;

/// `|K|` at the nodes, row-major, 1/m²: seeds of the curvature metric are taken in ascending order of it, so that the first clusters
/// are those of the flattest ground. Cost: one evaluation of the surface per node.
#[must_use]
pub fn gaussian_ranks(surface: &dyn ParametricSurface) -> Vec<f64> {
    let of_row = |row| {
        let jets = surface.row_space_jets(row).into_iter();
        jets.map(|jet| jet.mean_and_gaussian()[1].abs())
    };
    (0..surface.rows()).into_par_iter().flat_map_iter(of_row).collect()
}

/// `γ1 γ2` at the nodes, row-major: the order of seeds for the difference metric. Cost: as to bind the metric.
///
/// # Errors
/// A `δ` of the curvature tensor out of range; cancelled.
pub fn difference_ranks(
    surface: &dyn ParametricSurface,
    difference: &Difference,
    control: &Control,
) -> Result<Vec<f64>> {
    let changes = difference.changes(surface, control)?;
    Ok(changes.iter().map(|change| change.gamma.det()).collect())
}

/// The cluster `D_ε(p)`: the open nodes within `epsilon` (unit of the metric) of a node, as places in the row-major grid, each with its
/// distance. Empty if the node is closed.
///
/// # Cost
/// That of a solve in a window around the cluster, some four times its size: what lies beyond is not looked at.
///
/// # Errors
/// [`Error::Usage`] if the seed is not on the grid or `epsilon` is no number, 0 or more; [`Error::Cancelled`].
pub fn cluster(
    field: &TensorField,
    seed: [usize; 2],
    epsilon: f64,
    control: &Control,
) -> Result<Vec<(usize, f32)>> {
    /// Half the side of the first window.
    const REACH: usize = 24;
    let [col, row] = seed;
    if col >= field.cols() || row >= field.rows() {
        return Err(Error::usage(format!("the seed ({col}, {row}) is not on the grid")));
    }
    if !field.is_open(col, row) {
        return Ok(Vec::new());
    }
    let stop = Stop::Distance(epsilon);
    let mut reach = REACH;
    loop {
        let span = |at: usize, count: usize| at.saturating_sub(reach)..count.min(at + reach);
        let (part, first) = field.crop([span(col, field.cols()), span(row, field.rows())]);
        let start = DVec2::new((col - first[0]) as f64, (row - first[1]) as f64);
        let map = Solver::default().solve_field(part, &[start.into()], &stop, control)?;
        if let Some(nodes) = held(&map, first, field) {
            return Ok(nodes);
        }
        reach *= 2;
    }
}

/// The reached nodes of a map of a part of the field that begins at `first`; `None` if some lie at its border, beyond which there is more.
fn held(map: &DistanceMap, first: [usize; 2], field: &TensorField) -> Option<Vec<(usize, f32)>> {
    let at_border = |at: usize, count: usize, first: usize, all: usize| {
        at == 0 && first > 0 || at + 1 == count && first + count < all
    };
    let mut nodes = Vec::new();
    for row in 0..map.rows() {
        for col in 0..map.cols() {
            let value = map.at_node(col, row) as f32;
            if value.is_finite() {
                if at_border(col, map.cols(), first[0], field.cols())
                    || at_border(row, map.rows(), first[1], field.rows())
                {
                    return None;
                }
                nodes.push(((first[1] + row) * field.cols() + first[0] + col, value));
            }
        }
    }
    Some(nodes)
}

/// Clusters that together hold all open nodes.
#[derive(Debug)]
pub(super) struct Cover {
    /// Their seeds, as places in the row-major grid.
    pub(super) seeds: Vec<usize>,
    /// Their radius, in the unit of the metric.
    pub(super) epsilon: f64,
}

/// Covers the open nodes with clusters of radius `epsilon`, seeds in ascending order of their class of `ranks`, see [`class`]. Of
/// the nodes of a class that no cluster holds yet the farthest from the seeds so far is next, of equals that of lower rank, then the
/// first in the grid. The very first seed is the node of the lowest class that is farthest from the lowest node. Without
/// `epsilon`, half of the largest distance from the first seed.
///
/// # Errors
/// More than [`MOST`] clusters; cancelled.
pub(super) fn cover(
    field: &TensorField,
    ranks: &[f64],
    epsilon: Option<f64>,
    control: &Control,
) -> Result<Cover> {
    let cols = field.cols();
    let is_open = |&(_, node): &(f64, usize)| field.is_open(node % cols, node / cols);
    let mut order: Vec<_> = ranks.iter().copied().zip(0..).filter(is_open).collect();
    order.par_sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let (sum, count) = order
        .iter()
        .filter(|(rank, _)| rank.is_finite())
        .fold((0.0, 0.0), |(sum, count), (rank, _)| (sum + rank, count + 1.0));
    let class = |rank: f64| class(rank, sum / count);
    let classes: Vec<_> = order.chunk_by(|a, b| class(a.0) == class(b.0)).collect();
    let Some(&lowest) = classes.first() else {
        return Ok(Cover { seeds: Vec::new(), epsilon: epsilon.unwrap_or(0.0) });
    };

    let quiet = control.quiet();
    let mut distances = Distances::new(field, &quiet);
    distances.add(lowest[0].1, f64::INFINITY)?;
    let (first, _) = distances.farthest(lowest);
    distances = Distances::new(field, &quiet);
    distances.add(first, f64::INFINITY)?;
    let epsilon = epsilon.unwrap_or_else(|| 0.5 * f64::from(distances.farthest(&order).1));
    let mut seeds = vec![first];
    for class in classes {
        // Positive floats are in the order of their bits. Distances in the heap may have shrunk since.
        let at = |i: usize| (distances.nearest[class[i].1].to_bits(), Reverse(i));
        let mut heap: BinaryHeap<_> = (0..class.len()).map(at).collect();
        while let Some((known, Reverse(i))) = heap.pop() {
            let node = class[i].1;
            let now = distances.nearest[node];
            if f64::from(now) <= epsilon {
                continue;
            }
            if now.to_bits() < known {
                heap.push((now.to_bits(), Reverse(i)));
                continue;
            }
            if seeds.len() == MOST {
                return Err(Error::usage(format!(
                    "clusters of radius {epsilon} are too small: {MOST} of them do not cover the surface; choose a larger \
                     epsilon"
                )));
            }
            // Beyond that it is nearest to no node of the class. To nodes of later classes distances are then no less than the true ones.
            distances.add(node, f64::from(now))?;
            seeds.push(node);
            control.report("covering", epsilon / f64::from(now));
        }
    }
    Ok(Cover { seeds, epsilon })
}

/// The class of a rank: ranks within a tenth of their mean count as equal. What differs by less is decided by the sampling, and
/// surfaces of like shape would be cut at different places. What has no rank is in a class of its own, the last.
fn class(rank: f64, mean: f64) -> u64 {
    if rank.is_finite() { (rank / (0.1 * mean)) as u64 } else { u64::MAX }
}

/// The distance of each node to the nearest seed so far.
struct Distances<'a> {
    field: &'a TensorField,
    control: &'a Control,
    nearest: Vec<f32>,
}

impl<'a> Distances<'a> {
    fn new(field: &'a TensorField, control: &'a Control) -> Self {
        Self { field, control, nearest: vec![f32::INFINITY; field.cols() * field.rows()] }
    }

    /// Adds a seed, to be known as far as `reach`.
    fn add(&mut self, seed: usize, reach: f64) -> Result<()> {
        let cols = self.field.cols();
        for (node, g) in cluster(self.field, [seed % cols, seed / cols], reach, self.control)? {
            self.nearest[node] = self.nearest[node].min(g);
        }
        // Where the metric is too extreme to seed a node, its cluster is empty.
        self.nearest[seed] = 0.0;
        Ok(())
    }

    /// The farthest of some nodes that can be reached, of equals the first, and its distance.
    fn farthest(&self, nodes: &[(f64, usize)]) -> (usize, f32) {
        let distances = nodes.iter().map(|&(_, node)| (node, self.nearest[node]));
        let reached = distances.filter(|(_, g)| g.is_finite());
        reached.fold((nodes[0].1, 0.0), |most, next| if next.1 > most.1 { next } else { most })
    }
}

/// Grid coordinates of a place in the row-major grid.
pub(super) fn node(place: usize, cols: usize) -> DVec2 {
    DVec2::new((place % cols) as f64, (place / cols) as f64)
}
