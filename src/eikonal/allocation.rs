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
        let predecessors = predecessors(&self.field, &self.factors, self.corrected());
        let mut path = Vec::new();
        for first in 0..labels.len() {
            let mut at = first;
            while labels[at] == UNKNOWN {
                labels[at] = PENDING;
                path.push(at);
                match self.beside(at % cols, at / cols, predecessors[at]) {
                    Some((col, row)) => at = row * cols + col,
                    None => labels[at] = NONE,
                }
            }
            // A path in a circle, where a step is lost in the rounding of the values, leads nowhere.
            let label = if labels[at] == PENDING { NONE } else { labels[at] };
            path.drain(..).for_each(|node| labels[node] = label);
        }
        labels.into_iter().map(|label| (label < NONE).then_some(label)).collect()
    }

    /// The labels of the nodes that kept their start value, but for a little.
    fn seed_labels(&self) -> Vec<u32> {
        /// As a share of a cell: the updates beside a start gain 1e-4 or so by rounding.
        const LITTLE: f64 = 0.01;
        let mut labels = vec![UNKNOWN; self.cols() * self.rows()];
        let seeds = |col: usize, row: usize, seed: f32, region: u32| {
            let label = &mut labels[row * self.cols() + col];
            let Some(metric) = self.field.metric(col, row) else { return };
            let most = ROUNDED_UP * self.stored(col, row) + LITTLE * metric.det().sqrt().sqrt();
            if self.is_reached(col, row) && f64::from(seed) <= most {
                *label = region.min(*label);
            }
        };
        // The map was seeded the same way without error.
        let _ = source::seed_all(&self.field, &self.starts, seeds);
        labels
    }

    /// The node at a place of the [`RING`].
    fn beside(&self, col: usize, row: usize, place: u8) -> Option<(usize, usize)> {
        let (i, j) = *RING.get(usize::from(place))?;
        self.field.tiling.node(col as isize + i as isize, row as isize + j as isize)
    }
}
