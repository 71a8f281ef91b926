//! Clusters that cover a grid.

use glam::DVec2;
use rayon::prelude::*;

use crate::eikonal::TensorField;
use crate::metric::SurfaceMetric;
use crate::{Control, DistanceMap, Error, MetricField, ParametricSurface, Result, Solver, Stop};

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

impl MetricField<'_> {
    /// What the nodes are ranked by as seeds, row-major: `γ1 γ2` on the difference metric, which is least where the shape changes
    /// least and known since the metric was bound; [`gaussian_ranks`] on the others.
    #[must_use]
    pub fn seed_ranks(&self) -> Vec<f64> {
        self.gamma_products().map_or_else(|| gaussian_ranks(self.surface()), <[f64]>::to_vec)
    }
}

impl SurfaceMetric<'_> {
    /// What the nodes are ranked by as seeds, as [`MetricField::seed_ranks`].
    #[must_use]
    pub fn seed_ranks(&self) -> Vec<f64> {
        self.gamma_products().map_or_else(|| gaussian_ranks(self.surface()), <[f64]>::to_vec)
    }
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

/// Covers the open nodes with clusters of radius `epsilon`: the first node in ascending order of `ranks` that no cluster
/// holds yet is the next seed. Of equals the first in the grid; what has no rank comes last. Without `epsilon`, half of the
/// largest distance from the first seed.
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
    let mut seeds = Vec::new();
    let quiet = control.quiet();
    // For the largest distance all is looked at.
    let reach = if epsilon.is_some() { REACH } else { cols.max(field.rows()) };
    let mut clusters = Clusters { field, reach, looked_at: 0 };
    let mut around =
        |place: usize, epsilon: f64| clusters.around([place % cols, place / cols], epsilon, &quiet);
    let epsilon = match (epsilon, order.first()) {
        (Some(epsilon), _) => epsilon,
        (None, Some(&(_, first))) => {
            let all = around(first, f64::INFINITY)?;
            0.5 * f64::from(all.iter().fold(0f32, |most, &(_, value)| most.max(value)))
        }
        (None, None) => 0.0,
    };
    let mut is_held = vec![false; ranks.len()];
    for (done, &(_, seed)) in order.iter().enumerate() {
        if is_held[seed] {
            continue;
        }
        if seeds.len() == MOST {
            return Err(Error::usage(format!(
                "clusters of radius {epsilon} are too small: {MOST} of them do not cover the surface; choose a larger \
                 epsilon"
            )));
        }
        control.report("covering", done as f64 / order.len() as f64);
        around(seed, epsilon)?.iter().for_each(|&(place, _)| is_held[place] = true);
        // Where the metric is too extreme to seed a node, its cluster is empty.
        is_held[seed] = true;
        seeds.push(seed);
    }
    Ok(Cover { seeds, epsilon })
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
