//! Steps of a route through a single cell, where interpolation across walls would mislead.

use glam::DVec2;

use super::DistanceMap;
use super::source::has_line_of_sight;
use super::stencil::segment::segment;

impl DistanceMap {
    /// The best point on the border of the cells around `at`, by the update of the solver with `at` as the node, and its stored distance. `None`
    /// if no point in sight has a distance below `value`.
    pub(crate) fn descend_to_border(&self, at: DVec2, value: f64) -> Option<(DVec2, f64)> {
        let metric = self.field.metric_at(at)?;
        let mut best: Option<(f64, DVec2, f64)> = None;
        for (a, b) in self.borders(at) {
            let (pa, pb) = (point(a), point(b));
            let value_of =
                |(c, r)| Some(self.reached(c, r)? + self.factoring_term(at, point((c, r))));
            let (ga, gb) = (value_of(a), value_of(b));
            let mut offer = |to: DVec2, g: f64| {
                let sum = g + metric.norm(to - at);
                if to.distance(at) > MIN_STEP
                    && best.is_none_or(|(least, ..)| sum < least)
                    && let Some(g) = self.stored_at(to)
                    && g < value
                    && has_line_of_sight(&self.field, at, to)
                {
                    best = Some((sum, to, g));
                }
            };
            if let (Some(ga), Some(gb)) = (ga, gb) {
                let (_, theta) = segment(ga, pa - at, gb, pb - at, metric);
                offer(pa.lerp(pb, theta), ga + theta * (gb - ga));
            }
            for (p, g) in [(pa, ga), (pb, gb)] {
                if let Some(g) = g {
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
            .filter_map(|(c, r)| Some((point((c, r)), self.reached(c, r)?)))
            .filter(|&(p, _)| p != at && has_line_of_sight(&self.field, at, p))
            .min_by(|a, b| a.1.total_cmp(&b.1))
    }

    /// Edges of the cells that touch `at`, except those it lies on.
    fn borders(&self, at: DVec2) -> impl Iterator<Item = ((isize, isize), (isize, isize))> + '_ {
        let tiling = &self.field.tiling;
        let span =
            |axis: usize| tiling.span(axis, (at[axis] - 1e-9).floor(), (at[axis] + 1e-9).floor());
        let (cols, rows) = (span(0), span(1));
        let cells = rows.flat_map(move |row| cols.clone().map(move |col| (col, row)));
        cells
            .flat_map(|(c, r)| {
                [
                    ((c, r), (c + 1, r)),
                    ((c + 1, r), (c + 1, r + 1)),
                    ((c + 1, r + 1), (c, r + 1)),
                    ((c, r + 1), (c, r)),
                ]
            })
            .filter(move |&(a, b)| [a, b].iter().all(|&(c, r)| tiling.node(c, r).is_some()))
            .filter(move |&(a, b)| {
                let (p, q) = (point(a), point(b));
                (q - p).perp_dot(at - p).abs() > 1e-9
            })
    }
}

/// Shortest step, in cells.
const MIN_STEP: f64 = 1e-6;

fn point((col, row): (isize, isize)) -> DVec2 {
    DVec2::new(col as f64, row as f64)
}
