//! Which start region each node belongs to.

use glam::DVec2;
use rayon::prelude::*;

use super::update::RING;
use super::{DistanceMap, SLACK, source};

/// Not looked at yet.
const UNKNOWN: u32 = u32::MAX;
/// On the way that is being followed.
const PENDING: u32 = u32::MAX - 1;
/// No region: not reached.
const NONE: u32 = u32::MAX - 2;
/// No place on the ring.
const NOWHERE: u8 = u8::MAX;

impl DistanceMap {
    /// The start region (its place in the list given to the solver) that each node, row-major from the north-west, is
    /// nearest to; of equals, the first. `None` where not reached.
    ///
    /// A node has the region of the ring node nearest to the point its value came from, so borders between regions are
    /// right to about a cell.
    #[must_use]
    pub fn labels(&self) -> Vec<Option<u32>> {
        let cols = self.cols();
        let mut labels = self.seed_labels();
        let origins = self.origins(&labels);
        let mut way = Vec::new();
        for first in 0..labels.len() {
            let mut at = first;
            while labels[at] == UNKNOWN {
                labels[at] = PENDING;
                way.push(at);
                match self.beside(at % cols, at / cols, origins[at]) {
                    Some((col, row)) => at = row * cols + col,
                    None => labels[at] = NONE,
                }
            }
            // A way in a circle, where a step is lost in the rounding of the values, leads nowhere.
            let label = if labels[at] == PENDING { NONE } else { labels[at] };
            way.drain(..).for_each(|node| labels[node] = label);
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
            let most = SLACK * self.stored(col, row) + LITTLE * metric.det().sqrt().sqrt();
            if self.is_reached(col, row) && f64::from(seed) <= most {
                *label = region.min(*label);
            }
        };
        // The map was seeded the same way without error.
        let _ = source::seed_all(&self.field, &self.starts, seeds);
        labels
    }

    /// Of each node without a label the place on its [`RING`] that leads home, see [`origin`](Self::origin); [`NOWHERE`] if none.
    fn origins(&self, labels: &[u32]) -> Vec<u8> {
        let cols = self.cols().max(1);
        let mut origins = vec![NOWHERE; labels.len()];
        origins.par_chunks_mut(cols).zip(labels.par_chunks(cols)).enumerate().for_each(
            |(row, (origins, labels))| {
                for (col, (origin, label)) in origins.iter_mut().zip(labels).enumerate() {
                    if *label == UNKNOWN {
                        *origin = self.origin(col, row).map_or(NOWHERE, |k| k as u8);
                    }
                }
            },
        );
        origins
    }

    /// Of the two ends of the segment that a node's value came from, the one nearer to the point it came from; the other,
    /// if only that is lower than the node. `None` where not reached.
    fn origin(&self, col: usize, row: usize) -> Option<usize> {
        if !self.is_reached(col, row) {
            return None;
        }
        let (_, foot) = self.best_foot(col, row)?;
        let near = foot.round();
        // The foot lies between it and the end beyond.
        let far = near + (foot - near).signum() * (foot - near).abs().ceil();
        let ends = [near, far]
            .map(|step| RING.iter().position(|&(i, j)| step == DVec2::new(i.into(), j.into())));
        let here = self.stored(col, row);
        let is_lower = |&k: &usize| {
            self.beside(col, row, k as u8).is_some_and(|(c, r)| self.stored(c, r) < here)
        };
        // Beside a cone taken out both may be higher; the nearer one still leads there.
        ends.into_iter().flatten().find(is_lower).or(ends[0])
    }

    /// The node at a place of the [`RING`].
    fn beside(&self, col: usize, row: usize, place: u8) -> Option<(usize, usize)> {
        let (i, j) = *RING.get(usize::from(place))?;
        self.field.tiling.node(col as isize + i as isize, row as isize + j as isize)
    }
}
