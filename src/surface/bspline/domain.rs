//! Where a fit has knots: around the heights that are not void, a margin beyond them, and nowhere else.

use std::ops::Range;

use glam::DVec2;
use rayon::prelude::*;

use super::knots::FitPlan;
use crate::grid::GridFrame;

/// Whole numbers on each of a row of lines, as runs in ascending order that do not touch.
pub(in crate::surface) type Runs = Vec<Vec<Range<usize>>>;

/// The knots within a margin of a height, along either axis. Its border is to a fit what that of the grid is.
#[derive(Clone, Debug, PartialEq)]
pub(in crate::surface) struct Domain {
    /// Knots per node along each axis.
    density: DVec2,
    /// Whether it holds all knots.
    pub(in crate::surface) is_whole: bool,
    /// Of each row of knots, the columns.
    pub(in crate::surface) rows: Runs,
    /// Of each column of knots, the rows.
    pub(in crate::surface) columns: Runs,
}

impl Domain {
    /// All knots.
    pub(in crate::surface) fn whole(frame: &GridFrame, plan: &FitPlan) -> Self {
        let knots = plan.intervals.map(|intervals| intervals + 1);
        let all = |lines: usize, along: usize| vec![vec![0..along]; lines];
        let (rows, columns) = (all(knots[1], knots[0]), all(knots[0], knots[1]));
        Self { density: plan.density(frame), is_whole: true, rows, columns }
    }

    /// The knots at most `margin` knot intervals from a finite height, along both axes.
    pub(in crate::surface) fn around(
        frame: &GridFrame,
        heights: &[f64],
        plan: &FitPlan,
        margin: usize,
    ) -> Self {
        let knots = plan.intervals.map(|intervals| intervals + 1);
        let density = plan.density(frame);
        let of_nodes: Runs = heights
            .par_chunks(frame.cols())
            .map(|row| near_heights(row, density.x, margin, knots[0]))
            .collect();
        let rows: Runs = (0..knots[1])
            .into_par_iter()
            .map(|knot| {
                let first = (knot.saturating_sub(margin) as f64 / density.y).ceil() as usize;
                let last = ((knot + margin) as f64 / density.y) as usize;
                let last = last.min(frame.rows() - 1);
                union(&of_nodes[first.min(frame.rows())..last + 1])
            })
            .collect();
        let columns = transposed(&rows, knots[0]);
        let is_whole =
            rows.iter().flatten().map(ExactSizeIterator::len).sum::<usize>() == knots[0] * knots[1];
        Self { density, is_whole, rows, columns }
    }

    /// The runs of knots on which the nodes of row `row` are fitted: those of the rows of knots on either side of it.
    pub(in crate::surface) fn runs_at(&self, row: usize) -> Vec<Range<usize>> {
        let at = row as f64 * self.density.y;
        let last = self.rows.len() - 1;
        let (above, below) = ((at as usize).min(last), (at.ceil() as usize).min(last));
        match above == below || self.rows[above] == self.rows[below] {
            true => self.rows[above].clone(),
            false => union(&[self.rows[above].clone(), self.rows[below].clone()]),
        }
    }

    /// The columns of the nodes of a row that are fitted, of `cols`.
    pub(in crate::surface) fn nodes_at(&self, row: usize, cols: usize) -> Vec<Range<usize>> {
        let runs = self.runs_at(row);
        runs.iter().map(|run| nodes_of(run, self.density.x, cols)).collect()
    }

    /// Whether it holds the knots in `columns` of each row in `rows`.
    pub(in crate::surface) fn holds(&self, columns: &Range<usize>, rows: Range<usize>) -> bool {
        self.rows[rows].iter().all(|runs| {
            let next = runs.partition_point(|run| run.end < columns.end);
            runs.get(next).is_some_and(|run| run.start <= columns.start)
        })
    }
}

/// The nodes between the first and the last of a run of knots, of an axis with so many nodes.
pub(in crate::surface) fn nodes_of(run: &Range<usize>, density: f64, nodes: usize) -> Range<usize> {
    // Wide enough for the rounding of places of knots.
    const ROUNDING: f64 = 1e-9;
    let first = ((run.start as f64 - ROUNDING) / density).ceil().max(0.0) as usize;
    let last = (((run.end - 1) as f64 + ROUNDING) / density) as usize;
    first..last.min(nodes - 1) + 1
}

/// The nodes that a knot is the nearest to, of an axis with so many nodes.
pub(in crate::surface) fn nearest_nodes(knot: usize, density: f64, nodes: usize) -> Range<usize> {
    let [first, end] = [-0.5, 0.5].map(|aside| ((knot as f64 + aside) / density).ceil().max(0.0));
    nodes.min(first as usize)..nodes.min(end as usize)
}

/// The knots of a line within `margin` of a node with a finite height.
fn near_heights(line: &[f64], density: f64, margin: usize, knots: usize) -> Vec<Range<usize>> {
    let mut runs: Vec<Range<usize>> = Vec::new();
    let mut at = 0;
    while let Some(void) = line[at..].iter().position(|z| z.is_finite()) {
        let first = at + void;
        let count = line[first..].iter().position(|z| !z.is_finite());
        at = count.map_or(line.len(), |count| first + count);
        let start = (first as f64 * density).ceil() as usize;
        let end = ((at - 1) as f64 * density) as usize + margin + 1;
        let run = start.saturating_sub(margin)..end.min(knots);
        match runs.last_mut() {
            Some(last) if last.end >= run.start => last.end = run.end,
            _ => runs.push(run),
        }
    }
    runs
}

/// The numbers in any of several lines.
fn union(lines: &[Vec<Range<usize>>]) -> Vec<Range<usize>> {
    let mut all: Vec<_> = lines.iter().flatten().cloned().collect();
    all.sort_unstable_by_key(|run| run.start);
    let mut runs: Vec<Range<usize>> = Vec::new();
    for run in all {
        match runs.last_mut() {
            Some(last) if last.end >= run.start => last.end = last.end.max(run.end),
            _ => runs.push(run),
        }
    }
    runs
}

/// The lines of each number.
fn transposed(lines: &Runs, count: usize) -> Runs {
    let mut columns: Runs = vec![Vec::new(); count];
    for (line, runs) in lines.iter().enumerate() {
        for column in runs.iter().cloned().flatten() {
            match columns[column].last_mut() {
                Some(last) if last.end == line => last.end += 1,
                _ => columns[column].push(line..line + 1),
            }
        }
    }
    columns
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grid::Ground;

    #[test]
    fn it_is_as_large_as_the_ground_and_its_margin() {
        let frame = GridFrame::new(300, 200, DVec2::ZERO, DVec2::ONE, Ground::METRES).unwrap();
        let mut heights = vec![f64::NAN; frame.nodes()];
        for row in 100..110 {
            heights[row * 300 + 50..row * 300 + 70].fill(1.0);
        }
        heights[0] = 1.0;
        let domain = Domain::around(&frame, &heights, &FitPlan::every_node(&frame, 3), 4);
        let knots = |runs: &Runs| runs.iter().flatten().map(ExactSizeIterator::len).sum::<usize>();
        assert_eq!(knots(&domain.rows), 18 * 28 + 5 * 5);
        assert_eq!(knots(&domain.columns), 18 * 28 + 5 * 5);
        assert_eq!((domain.rows[96][0].clone(), domain.columns[4][0].clone()), (46..74, 0..5));
        assert!(domain.holds(&(46..74), 96..114) && !domain.holds(&(46..75), 96..114));
    }

    #[test]
    fn every_node_with_a_height_lies_among_its_knots() {
        let frame = GridFrame::new(97, 61, DVec2::ZERO, DVec2::ONE, Ground::METRES).unwrap();
        let heights: Vec<f64> =
            (0..frame.nodes()).map(|i| if i * i % 37 == 3 { 1.0 } else { f64::NAN }).collect();
        for intervals in [[96, 60], [41, 60], [7, 4], [1, 3], [0, 0]] {
            let plan = FitPlan { degree: 3, intervals, cutoff: 0.0 };
            let domain = Domain::around(&frame, &heights, &plan, 4);
            for (i, _) in heights.iter().enumerate().filter(|(_, z)| z.is_finite()) {
                let runs = domain.nodes_at(i / 97, 97);
                assert!(runs.iter().any(|run| run.contains(&(i % 97))), "{intervals:?} {i}");
            }
        }
    }
}
