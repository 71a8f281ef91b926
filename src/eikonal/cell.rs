//! Steps through a single cell, for lines that must not cross walls.

use glam::DVec2;

use super::DistanceMap;
use super::source::sees;
use super::update::segment;

impl DistanceMap {
    /// The best point on the border of the cells around `at`: the solver's update with `at` as the node. `None` if the
    /// distance there is not lower than `value`.
    pub(crate) fn descend_to_border(&self, at: DVec2, value: f64) -> Option<(DVec2, f64)> {
        let metric = self.field.metric_at(at)?;
        let mut best: Option<(f64, DVec2, f64)> = None;
        for (a, b) in self.borders(at) {
            let (pa, pb) = (point(a), point(b));
            let ga = self.stored(a.0, a.1) + self.shift(at, pa);
            let gb = self.stored(b.0, b.1) + self.shift(at, pb);
            let ends = [(pa, ga, self.is_reached(a.0, a.1)), (pb, gb, self.is_reached(b.0, b.1))];
            let mut offer = |to: DVec2, g: f64| {
                let sum = g + metric.norm(to - at);
                if to.distance(at) > MIN_STEP
                    && best.is_none_or(|(least, ..)| sum < least)
                    && let Some(g) = self.stored_at(to)
                    && g < value
                    && sees(&self.field, at, to)
                {
                    best = Some((sum, to, g));
                }
            };
            if ends[0].2 && ends[1].2 {
                let (_, theta) = segment(ga, pa - at, gb, pb - at, metric);
                offer(pa.lerp(pb, theta), ga + theta * (gb - ga));
            }
            for (p, g, reached) in ends {
                if reached {
                    offer(p, g);
                }
            }
        }
        best.map(|(_, to, g)| (to, g))
    }

    /// The lowest reached corner of the cells around `at` that is in sight.
    pub(crate) fn lowest_corner(&self, at: DVec2) -> Option<(DVec2, f64)> {
        self.borders(at)
            .flat_map(|(a, b)| [a, b])
            .filter(|&(c, r)| self.is_reached(c, r))
            .map(|node| (point(node), self.stored(node.0, node.1)))
            .filter(|&(p, _)| p != at && sees(&self.field, at, p))
            .min_by(|a, b| a.1.total_cmp(&b.1))
    }

    /// Sides of the cells that touch `at`, without those it lies on.
    fn borders(&self, at: DVec2) -> impl Iterator<Item = ((usize, usize), (usize, usize))> + '_ {
        let first = |x: f64| (x - 1e-9).floor().max(0.0) as usize;
        let last =
            |x: f64, count: usize| ((x + 1e-9).floor() as usize).min(count.saturating_sub(2));
        let (cols, rows) = (self.cols(), self.rows());
        let cells = (first(at.y)..=last(at.y, rows))
            .flat_map(move |row| (first(at.x)..=last(at.x, cols)).map(move |col| (col, row)));
        cells
            .flat_map(|(c, r)| {
                [
                    ((c, r), (c + 1, r)),
                    ((c + 1, r), (c + 1, r + 1)),
                    ((c + 1, r + 1), (c, r + 1)),
                    ((c, r + 1), (c, r)),
                ]
            })
            .filter(move |&(a, b)| a.0.max(b.0) < cols && a.1.max(b.1) < rows)
            .filter(move |&(a, b)| {
                let (p, q) = (point(a), point(b));
                (q - p).perp_dot(at - p).abs() > 1e-9
            })
    }
}

/// Steps shorter than this, in cells, are no progress.
const MIN_STEP: f64 = 1e-6;

fn point((col, row): (usize, usize)) -> DVec2 {
    DVec2::new(col as f64, row as f64)
}
