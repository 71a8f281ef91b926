//! Clusters that cover a grid.

use glam::DVec2;
use rayon::prelude::*;

use crate::control::Control;
use crate::eikonal::{Balls, TensorField};
use crate::error::{Error, Result};
use crate::metric::MetricField;
use crate::surface::Surface;

/// Most clusters of a cover: beyond this `ε` is surely a mistake.
const MOST_CLUSTERS: usize = 1 << 16;

/// `|K|` at the nodes, row-major, 1/m²: seeds of the curvature metric are taken in ascending order of it, so that the first clusters
/// are those of the flattest ground. Cost: one evaluation of the surface per node.
#[must_use]
pub fn gaussian_ranks(surface: &dyn Surface) -> Vec<f64> {
    let rows = (0..surface.rows()).into_par_iter();
    rows.flat_map_iter(|row| surface.row_space_jets(row))
        .map(|jet| jet.mean_and_gaussian()[1].abs())
        .collect()
}

impl MetricField<'_> {
    /// What the nodes are ranked by as seeds, row-major: what the metric itself says
    /// ([`Norm::with_seed_ranks`](crate::metric::Norm::with_seed_ranks): `γ1 γ2` on the difference metric), else [`gaussian_ranks`] of its surface. Cost: a copy, or that of [`gaussian_ranks`].
    #[must_use]
    pub fn seed_ranks(&self) -> Vec<f64> {
        self.own_seed_ranks().map_or_else(|| gaussian_ranks(self.surface()), <[f64]>::to_vec)
    }
}

/// The cluster `D_ε(p)`: the open nodes within `epsilon` (unit of the metric) of the seed, given by its column and row. Each comes as its
/// index in the row-major grid with its distance; none if the seed is closed.
///
/// # Cost
/// That of the tiles of 16 × 16 nodes that hold the cluster; what lies beyond those next to them is not looked at. Besides, 4 bytes per node of
/// the grid are set aside, which takes at most 0.2 ms per million nodes.
///
/// # Errors
/// [`Error::Argument`] if the seed is not on the grid or `epsilon` is negative or not a number; [`Error::Cancelled`].
pub fn cluster(
    field: &TensorField,
    seed: [usize; 2],
    epsilon: f64,
    control: &Control,
) -> Result<Vec<(usize, f32)>> {
    let [col, row] = seed;
    if col >= field.cols() || row >= field.rows() {
        return Err(Error::argument("the seed", "not on the grid", "on it").at_node(col, row));
    }
    Ok(Balls::new(field).around(seed, epsilon, control)?.collect())
}

/// Clusters that together hold all open nodes.
#[derive(Debug)]
pub(super) struct SeedCover {
    /// Their seeds, as indices in the row-major grid.
    pub(super) seeds: Vec<usize>,
    /// Their radius, in the unit of the metric.
    pub(super) epsilon: f64,
}

/// Covers the open nodes with clusters of radius `epsilon`: the first node in ascending order of `ranks` that no cluster
/// holds yet is the next seed. Of equals the first in the grid; what has no rank comes last. Without `epsilon`, half of the
/// largest distance from the first seed.
///
/// # Errors
/// More than [`MOST_CLUSTERS`] clusters; cancelled.
pub(super) fn seed_cover(
    field: &TensorField,
    ranks: &[f64],
    epsilon: Option<f64>,
    control: &Control,
) -> Result<SeedCover> {
    let cols = field.cols();
    let is_open = |&(_, node): &(f64, usize)| field.is_open(node % cols, node / cols);
    let mut order: Vec<_> = ranks.iter().copied().zip(0..).filter(is_open).collect();
    order.par_sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let mut seeds = Vec::new();
    let quiet = control.quiet();
    let mut balls = Balls::new(field);
    let coordinates = |index: usize| [index % cols, index / cols];
    let epsilon = match (epsilon, order.first()) {
        (Some(epsilon), _) => epsilon,
        (None, Some(&(_, first))) => {
            let all = balls.around(coordinates(first), f64::INFINITY, &quiet)?;
            0.5 * f64::from(all.fold(0f32, |most, (_, value)| most.max(value)))
        }
        (None, None) => 0.0,
    };
    let mut is_held = vec![false; ranks.len()];
    for (done, &(_, seed)) in order.iter().enumerate() {
        if is_held[seed] {
            continue;
        }
        if seeds.len() == MOST_CLUSTERS {
            let held = is_held.iter().filter(|&&held| held).count();
            return Err(too_small(epsilon, held, order.len()));
        }
        control.report("covering", done as f64 / order.len() as f64);
        let held = balls.around(coordinates(seed), epsilon, &quiet)?;
        held.for_each(|(index, _)| is_held[index] = true);
        seeds.push(seed);
    }
    Ok(SeedCover { seeds, epsilon })
}

/// The error for a radius so small that [`MOST_CLUSTERS`] clusters hold only `held` of the `open` nodes.
fn too_small(epsilon: f64, held: usize, open: usize) -> Error {
    let share = held as f64 / open as f64;
    let advice = if held > 2 * MOST_CLUSTERS {
        // A cluster holds as many nodes as the square of its radius, the last ones fewer: to two digits.
        let larger = 1.5 * epsilon / share.sqrt();
        let scale = 10f64.powi(1 - larger.log10().floor() as i32);
        format!("one of {} may do", (larger * scale).ceil() / scale)
    } else {
        "most hold nothing but their seed".to_owned()
    };
    Error::argument(
        "epsilon",
        format!(
            "{epsilon:?}, so small that {MOST_CLUSTERS} clusters hold only {:.1} % of the surface",
            100.0 * share
        ),
        "larger",
    )
    .advise(advice)
}

/// Grid coordinates of a node, given by its index in the row-major grid.
pub(super) fn node(index: usize, cols: usize) -> DVec2 {
    DVec2::new((index % cols) as f64, (index / cols) as f64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linalg::Sym2;

    #[test]
    fn clusters_too_small_to_cover_are_refused() {
        let control = Control::default();
        let tensor = |_: usize, _: usize| Some(Sym2::new(1.0, 0.0, 1.0));
        let field = TensorField::from_fn(300, 300, tensor, &control).unwrap();
        let refusal = seed_cover(&field, &vec![0.0; 300 * 300], Some(0.0), &control).unwrap_err();
        assert!(refusal.to_string().contains("72.8 %"), "{refusal}");
        let refusal = too_small(0.2, 2 * MOST_CLUSTERS + 1, 8 * MOST_CLUSTERS);
        assert!(refusal.to_string().ends_with("one of 0.6 may do"), "{refusal}");
    }
}
