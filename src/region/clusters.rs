//! Clusters that cover a grid.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use glam::DVec2;
use rayon::prelude::*;

use crate::eikonal::TensorField;
use crate::{Control, DistanceMap, Error, Metric, ParametricSurface, Result, Solver, Stop};

/// Half the side of the window in which the first cluster is solved, in nodes.
const REACH: usize = 24;

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

/// What the nodes are ranked by as seeds under a metric, row-major: `γ1 γ2` on the difference metric, which is least where the shape
/// changes least, [`gaussian_ranks`] on the others. Cost: one evaluation of the surface per node; as to bind the difference metric.
///
/// # Errors
/// A `δ` of the curvature tensor out of range; cancelled.
pub fn seed_ranks(
    surface: &dyn ParametricSurface,
    metric: &Metric,
    control: &Control,
) -> Result<Vec<f64>> {
    let Metric::Difference(difference) = metric else { return Ok(gaussian_ranks(surface)) };
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
    let [col, row] = seed;
    if col >= field.cols() || row >= field.rows() {
        return Err(Error::usage(format!("the seed ({col}, {row}) is not on the grid")));
    }
    Clusters { field, reach: REACH, looked_at: 0 }.around(seed, epsilon, control)
}

/// Finds one cluster after the other.
struct Clusters<'a> {
    field: &'a TensorField,
    /// Half the side of the window that the next cluster is solved in, in nodes: a little more than the last one took.
    reach: usize,
    /// Nodes of all windows so far.
    looked_at: usize,
}

impl Clusters<'_> {
    /// See [`cluster`].
    fn around(
        &mut self,
        [col, row]: [usize; 2],
        epsilon: f64,
        control: &Control,
    ) -> Result<Vec<(usize, f32)>> {
        let field = self.field;
        if !field.is_open(col, row) {
            return Ok(Vec::new());
        }
        let stop = Stop::Distance(epsilon);
        loop {
            let span = |at: usize, count: usize| {
                at.saturating_sub(self.reach)..count.min(at + self.reach + 1)
            };
            let (part, first) = field.crop([span(col, field.cols()), span(row, field.rows())]);
            let start = DVec2::new((col - first[0]) as f64, (row - first[1]) as f64);
            let map = Solver::default().solve_field(part, &[start.into()], &stop, control)?;
            self.looked_at += map.cols() * map.rows();
            if let Some(nodes) = held(&map, first, field) {
                // A periodic direction is whole in any window.
                let [around, about] = field.tiling.periodic;
                let far = |&(place, _): &(usize, f32)| {
                    let across = (place % field.cols()).abs_diff(col);
                    let down = (place / field.cols()).abs_diff(row);
                    (if around { 0 } else { across }).max(if about { 0 } else { down })
                };
                let farthest = nodes.iter().map(far).max().unwrap_or(0);
                self.reach = farthest + farthest / 4 + 2;
                return Ok(nodes);
            }
            self.reach *= 2;
        }
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
    let mut distances = Distances::new(field, &quiet);
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
    clusters: Clusters<'a>,
    control: &'a Control,
    nearest: Vec<f32>,
}

impl<'a> Distances<'a> {
    fn new(field: &'a TensorField, control: &'a Control) -> Self {
        let clusters = Clusters { field, reach: REACH, looked_at: 0 };
        Self { clusters, control, nearest: vec![f32::INFINITY; field.cols() * field.rows()] }
    }

    /// Adds a seed, to be known as far as `reach`.
    fn add(&mut self, seed: usize, reach: f64) -> Result<()> {
        let cols = self.clusters.field.cols();
        for (node, g) in self.clusters.around([seed % cols, seed / cols], reach, self.control)? {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Sym2;

    #[test]
    fn clusters_look_at_few_nodes_beyond_their_own() {
        let tensor = |col: usize, row: usize| {
            let speed = 1.0 + 0.5 * (0.05 * (col + 2 * row) as f64).sin();
            Some(Sym2::new(speed, 0.0, 2.0 - speed))
        };
        let field = TensorField::from_fn(400, 400, tensor, &Control::default()).unwrap();
        for (epsilon, most) in [(5.0, 16.0), (20.0, 5.0), (80.0, 4.0)] {
            let mut clusters = Clusters { field: &field, reach: REACH, looked_at: 0 };
            let mut held = 0;
            for seed in (0..40).map(|i| [(i * 97) % 400, (i * 151) % 400]) {
                let nodes = clusters.around(seed, epsilon, &Control::default()).unwrap();
                // The window of the cluster before, and the distances in it, change little.
                let alone = cluster(&field, seed, epsilon, &Control::default()).unwrap();
                assert!(nodes.len().abs_diff(alone.len()) * 50 < alone.len(), "{seed:?}");
                held += nodes.len();
            }
            let share = clusters.looked_at as f64 / held as f64;
            assert!(share < most, "{epsilon}: {share}");
        }
    }
}
