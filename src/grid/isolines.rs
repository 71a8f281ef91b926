//! Isolines of a field on a grid, by marching squares.
//!
//! A line crosses an edge between two nodes where the field, linear along the edge, takes the level
//! (Lorensen & Cline 1987 in two dimensions). Cells with a corner that has no value are left out, so
//! lines end there instead of running along the hole. (Contouring crates close their rings around
//! holes and along the border, which would draw lines that are not isolines.)

use glam::DVec2;
use rayon::prelude::*;

use super::GridFrame;
use crate::error::{Error, Result};

/// The lines on which a field has one value.
#[derive(Clone, Debug, PartialEq)]
pub struct Isoline {
    /// The value.
    pub level: f64,
    /// Polylines in grid coordinates; a closed one ends with its first point. Walking along a line,
    /// higher values are on the left as seen on a north-up map.
    pub lines: Vec<Vec<DVec2>>,
}

/// Most levels that [`levels_by_step`] gives: more cannot be told apart on any picture.
const MAX_LEVELS: usize = 1000;

/// The positive multiples of `step` up to the largest finite value.
///
/// # Errors
/// [`Error::Argument`] if `step` is not positive or gives more than a thousand levels.
pub fn levels_by_step(values: &[f32], step: f64) -> Result<Vec<f64>> {
    if !(step.is_finite() && step > 0.0) {
        return Err(Error::argument("the isoline step", step, "positive"));
    }
    let top = values.iter().filter(|v| v.is_finite()).fold(0f32, |a, &b| a.max(b));
    let count = (f64::from(top) / step).floor();
    if count > MAX_LEVELS as f64 {
        return Err(Error::argument(
            "the isoline step",
            step,
            format!(
                "at least {}, for at most {MAX_LEVELS} isolines up to {top}",
                round_step(f64::from(top), MAX_LEVELS)
            ),
        ));
    }
    Ok((1..=count as usize).map(|k| k as f64 * step).collect())
}

/// The smallest of 1, 2, 5 times a power of ten that divides `extent` into at most `parts` parts;
/// 1 if `extent` is not a positive number.
#[must_use]
pub fn round_step(extent: f64, parts: usize) -> f64 {
    let least = extent / parts.max(1) as f64;
    if !(least.is_finite() && least > f64::MIN_POSITIVE) {
        return 1.0;
    }
    let power = 10f64.powf(least.log10().floor());
    // The last factor catches a logarithm rounded down.
    let factor =
        [1.0, 2.0, 5.0, 10.0, 20.0].into_iter().find(|f| f * power >= least * (1.0 - 1e-9));
    factor.map_or(least, |f| f * power)
}

/// Isolines at the ascending `levels` of `values` (row-major, `NaN` or infinite where there is none).
///
/// # Errors
/// [`Error::Argument`] if the number of values is not that of the nodes, or levels do not ascend.
pub fn isolines(frame: &GridFrame, values: &[f32], levels: &[f64]) -> Result<Vec<Isoline>> {
    if values.len() != frame.nodes() {
        return Err(Error::argument(
            "the number of values",
            values.len(),
            format!("{}, that of the nodes", frame.nodes()),
        ));
    }
    if !levels.is_sorted_by(|a, b| a < b) {
        return Err(Error::argument("the list of isoline levels", "not ascending", "ascending"));
    }
    let field = Field { cols: frame.cols(), rows: frame.rows(), values };
    let segments = field.segments(levels);
    Ok(levels
        .par_iter()
        .zip(segments)
        .map(|(&level, segments)| Isoline { level, lines: field.link(segments, level) })
        .collect())
}

/// A segment of an isoline inside one cell, between two edges of the grid. Edge `2i` leads from node `i`
/// to the east, edge `2i + 1` to the south.
#[derive(Clone, Copy)]
struct Segment {
    start: usize,
    end: usize,
}

struct Field<'a> {
    cols: usize,
    rows: usize,
    values: &'a [f32],
}

impl Field<'_> {
    /// The segments of each level, in one pass over the cells.
    fn segments(&self, levels: &[f64]) -> Vec<Vec<Segment>> {
        let mut segments = vec![Vec::new(); levels.len()];
        for row in 1..self.rows {
            for col in 1..self.cols {
                let node = (row - 1) * self.cols + col - 1;
                let below = node + self.cols;
                // Corners clockwise on the map from the north-west; edge k leads to corner k + 1.
                let corner = [node, node + 1, below + 1, below].map(|n| f64::from(self.values[n]));
                if !corner.iter().all(|v| v.is_finite()) {
                    continue;
                }
                let low = corner.iter().copied().fold(f64::INFINITY, f64::min);
                let high = corner.iter().copied().fold(f64::NEG_INFINITY, f64::max);
                let first = levels.partition_point(|&l| l <= low);
                let edges = [2 * node, 2 * node + 3, 2 * below, 2 * node + 1];
                for (level, segments) in levels.iter().zip(&mut segments).skip(first) {
                    if *level > high {
                        break;
                    }
                    cell_segments(corner, *level, |a, b| {
                        segments.push(Segment { start: edges[a], end: edges[b] });
                    });
                }
            }
        }
        segments
    }

    /// Joins the segments of one level end to start. Each edge is the start of at most one segment and the end of at
    /// most one, as the walks around the cells on its two sides pass it in opposite directions.
    fn link(&self, mut segments: Vec<Segment>, level: f64) -> Vec<Vec<DVec2>> {
        segments.sort_unstable_by_key(|s| s.start);
        let next: Vec<Option<usize>> = segments
            .iter()
            .map(|s| segments.binary_search_by_key(&s.end, |t| t.start).ok())
            .collect();
        let mut heads = vec![true; segments.len()];
        next.iter().flatten().for_each(|&n| heads[n] = false);

        let mut used = vec![false; segments.len()];
        let mut lines = Vec::new();
        // Open lines first, from their heads; what is then left are closed ones.
        let open = (0..segments.len()).filter(|&i| heads[i]);
        let rest = 0..segments.len();
        for first in open.chain(rest) {
            if used[first] {
                continue;
            }
            let mut line = vec![self.crossing(segments[first].start, level)];
            let mut at = Some(first);
            while let Some(i) = at.filter(|&i| !used[i]) {
                used[i] = true;
                line.push(self.crossing(segments[i].end, level));
                at = next[i];
            }
            // A line through a node crosses several edges at one point.
            line.dedup();
            if line.len() > 1 {
                lines.push(line);
            }
        }
        lines
    }

    /// Where the field takes the value `level` on `edge`.
    fn crossing(&self, edge: usize, level: f64) -> DVec2 {
        let node = edge / 2;
        let along = if edge.is_multiple_of(2) { DVec2::X } else { DVec2::Y };
        let other = if edge.is_multiple_of(2) { node + 1 } else { node + self.cols };
        let [a, b] = [node, other].map(|n| f64::from(self.values[n]));
        let from = DVec2::new((node % self.cols) as f64, (node / self.cols) as f64);
        from + along * ((level - a) / (b - a))
    }
}

/// Calls `segment(from, to)` with the edges (0 to 3) that the isoline of one cell joins. A segment
/// starts where the walk around the corners rises above the level and ends where it falls below.
fn cell_segments(corner: [f64; 4], level: f64, mut segment: impl FnMut(usize, usize)) {
    let above = corner.map(|v| v >= level);
    let rises = |k: usize| !above[k] && above[(k + 1) % 4];
    let falls = |k: usize| above[k] && !above[(k + 1) % 4];
    let saddle = above[0] == above[2] && above[1] == above[3] && above[0] != above[1];
    if saddle {
        // The mean of the corners, the bilinear value in the middle, decides which pair is connected.
        let middle = corner.iter().sum::<f64>() / 4.0 >= level;
        for k in (0..4).filter(|&k| rises(k)) {
            segment(k, if middle { (k + 3) % 4 } else { (k + 1) % 4 });
        }
    } else if let (Some(a), Some(b)) = ((0..4).find(|&k| rises(k)), (0..4).find(|&k| falls(k))) {
        segment(a, b);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grid::Ground;

    fn sampled(cols: usize, rows: usize, f: impl Fn(f64, f64) -> f64) -> (GridFrame, Vec<f32>) {
        let frame =
            GridFrame::new(cols, rows, DVec2::ZERO, DVec2::ONE, Ground::METRES).expect("a frame");
        let values =
            (0..cols * rows).map(|i| f((i % cols) as f64, (i / cols) as f64) as f32).collect();
        (frame, values)
    }

    #[test]
    fn circles_are_closed_and_of_the_right_radius() {
        let (frame, values) = sampled(41, 41, |x, y| (x - 20.0).hypot(y - 20.0));
        let found = isolines(&frame, &values, &[5.0, 10.0, 15.0]).unwrap();
        for Isoline { level, lines } in found {
            assert_eq!(lines.len(), 1, "at {level}");
            assert_eq!(lines[0].first(), lines[0].last());
            for p in &lines[0] {
                // Chord error of linear interpolation: h²/(8 r).
                let r = (*p - DVec2::splat(20.0)).length();
                assert!((r - level).abs() <= 0.25 / level + 1e-6, "{r} at {level}");
            }
        }
    }

    #[test]
    fn no_line_runs_along_a_hole_or_the_border() {
        let (frame, mut values) = sampled(30, 20, |x, _| x);
        values[10 * 30 + 10] = f32::NAN;
        values[10 * 30 + 11] = f32::INFINITY;
        let found = isolines(&frame, &values, &[10.5, 20.5]).unwrap();
        assert_eq!(found[0].lines.len(), 2, "the hole cuts the line in two");
        assert!(found[0].lines.iter().flatten().all(|p| (p.x - 10.5).abs() < 1e-6));
        assert_eq!(found[1].lines.len(), 1);
        assert_eq!(found[1].lines[0].len(), 20);
    }

    #[test]
    fn saddles_and_levels_through_nodes_give_whole_lines() {
        let (frame, values) = sampled(21, 21, |x, y| (x - 9.5) * (y - 9.5));
        let hyperbola = isolines(&frame, &values, &[0.1]).unwrap();
        assert_eq!(hyperbola[0].lines.len(), 2);
        let (frame, values) = sampled(9, 9, |x, y| (x - 4.0).abs() + (y - 4.0).abs());
        let diamond = isolines(&frame, &values, &[2.0]).unwrap();
        assert_eq!(diamond[0].lines.len(), 1);
        assert_eq!(diamond[0].lines[0].first(), diamond[0].lines[0].last());
    }

    #[test]
    fn higher_values_are_on_the_left() {
        let (frame, values) = sampled(3, 3, |x, _| x);
        let line = &isolines(&frame, &values, &[0.5]).unwrap()[0].lines[0];
        assert!(line[0].y < line[line.len() - 1].y, "southward, the high east on the left");
    }

    #[test]
    fn tiny_and_empty_grids_have_no_lines() {
        for (cols, rows) in [(1, 1), (1, 5), (5, 1)] {
            let (frame, values) = sampled(cols, rows, |x, y| x + y);
            assert!(isolines(&frame, &values, &[0.5]).unwrap()[0].lines.is_empty());
        }
        let (frame, values) = sampled(4, 4, |_, _| f64::NAN);
        assert!(isolines(&frame, &values, &[0.5]).unwrap()[0].lines.is_empty());
        assert!(isolines(&frame, &values[1..], &[0.5]).is_err());
    }

    #[test]
    fn steps_are_round_and_bounded() {
        assert_eq!(round_step(1000.0, 10), 100.0);
        assert_eq!(round_step(1001.0, 10), 200.0);
        assert_eq!(round_step(0.0, 10), 1.0);
        assert_eq!(round_step(f64::NAN, 10), 1.0);
        assert!((round_step(0.037, 10) - 0.005).abs() < 1e-15);
        assert_eq!(levels_by_step(&[1.0, 35.0, f32::INFINITY], 10.0).unwrap(), [10.0, 20.0, 30.0]);
        assert!(levels_by_step(&[1e9], 1.0).is_err());
        assert!(levels_by_step(&[1.0], 0.0).is_err());
    }
}
