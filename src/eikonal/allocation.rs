//! Allocation: which start region each node belongs to.

use super::distance_map::DistanceMap;
use super::interpolation::ROUNDED_UP;
use super::predecessor::predecessors;
use super::source;
use super::stencil::ring::RING;

/// Not looked at yet.
const UNKNOWN: u32 = u32::MAX;
/// On the path that is being followed.
const PENDING: u32 = u32::MAX - 1;
/// No region: not reached.
const NONE: u32 = u32::MAX - 2;

impl DistanceMap {
    /// The start region (its place in the list given to the solver) that each node, row-major from the north-west, is
    /// nearest to; of equals, the first. `None` where not reached.
    ///
    /// A node has the region of the ring node nearest to the point its value came from, so borders between regions are
    /// right to about a cell.
    #[must_use]
    pub fn allocation(&self) -> Vec<Option<u32>> {
        let cols = self.cols();
        let mut labels = self.seed_labels();
        let predecessors = predecessors(&self.field, &self.factors, &self.corrected());
        let mut path = Vec::new();
        for first in 0..labels.len() {
            let mut at = first;
            while labels[at] == UNKNOWN {
                labels[at] = PENDING;
                path.push(at);
                match self.ring_node(at % cols, at / cols, predecessors[at]) {
                    Some((col, row)) => at = row * cols + col,
                    None => labels[at] = NONE,
                }
            }
            // Paths may be circular where a step is lost in the rounding of the values; then there is no region.
            let label = if labels[at] == PENDING { NONE } else { labels[at] };
            path.drain(..).for_each(|node| labels[node] = label);
        }
        labels.into_iter().map(|label| (label < NONE).then_some(label)).collect()
    }

    /// The labels of the nodes whose value is a start value, within rounding.
    fn seed_labels(&self) -> Vec<u32> {
        /// As a share of a cell: updates next to a start lower values by 1e-4 or so through rounding.
        const ROUNDING_CELLS: f64 = 0.01;
        let mut labels = vec![UNKNOWN; self.cols() * self.rows()];
        let seeds = |col: usize, row: usize, seed: f32, region: u32| {
            let label = &mut labels[row * self.cols() + col];
            let Some(metric) = self.field.metric(col, row) else { return };
            let most =
                ROUNDED_UP * self.stored(col, row) + ROUNDING_CELLS * metric.det().sqrt().sqrt();
            if self.is_reached(col, row) && f64::from(seed) <= most {
                *label = region.min(*label);
            }
        };
        // Cannot fail: the map was made with the same start values.
        let _ = source::seed_all(&self.field, &self.starts, seeds);
        labels
    }

    /// The node at a place of the [`RING`].
    fn ring_node(&self, col: usize, row: usize, place: u8) -> Option<(usize, usize)> {
        let (i, j) = *RING.get(usize::from(place))?;
        self.field.tiling.node(col as isize + i as isize, row as isize + j as isize)
    }
}
