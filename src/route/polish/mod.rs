//! Polishing: a line is moved sideways until its length on the surface is least.
//!
//! The traced line inherits the error of the distance it descends on: it lies up to a cell or two off the
//! shortest line. From there Newton's method finds that line on the metric itself. With a unit vector `n_i` across the
//! line at each point, the points `p_i + s_i n_i` make the segments `d = p_{i+1} − p_i` with middles `c`, and
//!
//! ```text
//!   L(s) = Σ √(dᵀ M(c) d)  →  min ,      both ends fixed
//! ```
//!
//! Each term depends on two neighbours, so the Hessian is tridiagonal. Points cannot move along the line: that leaves
//! its shape free, and they cannot gather where the sum is too small an estimate of the length (as they would with
//! both coordinates free, skipping what is costly). A shift in proportion to the tension of the segments, `n_iᵀ M n_i / |d|`, makes
//! the Hessian positive definite and the steps decrease `L` (Levenberg, Marquardt; Nocedal and Wright, Numerical
//! Optimization, ch. 10).
//!
//! A point that would meet a wall is held before it. What was not shortened by a finer quadrature stays as traced.
//!
//! Where the metric jumps, `L` has no derivatives to go by, and one corner of costly ground stops the whole line. Such a line is
//! searched for by dynamic programming (Amini, Weymouth, Jain, IEEE PAMI 12, 1990), which needs none.

mod newton;
mod search;
#[cfg(test)]
mod tests;

use glam::DVec2;

use self::newton::relax;
use self::search::search;
use crate::linalg::Sym2;
use crate::metric::length_along;

/// Longest segment, in cells. The curvature tensor changes within a cell: on rough ground segments of one cell shorten routes
/// by a half to two thirds of what those of half a cell do, a quarter by 1.1 times as much for twice the work.
const SEGMENT: f64 = 0.5;
/// Most steps of Newton's method, and of the search at each stride. Enough for all but a few lines on the roughest ground; smooth metrics need 3 to 5.
const MOST_STEPS: usize = 40;
/// A line that ends with a larger shift hardly moved, for the metric jumps next to it. The curvature tensor on rough ground ends
/// with up to 200, costs that jump by 1 : 10 with 70 to 3000, by 1 : 50 with 27 000.
const JUMP: f64 = 1e3;

/// The line, nowhere longer than `line`, between the same ends. `metric` is `M` in grid coordinates; `clear` says
/// whether one may go straight from one point to another nearby.
pub(super) fn polish(
    line: &[DVec2],
    metric: &impl Fn(DVec2) -> Sym2,
    clear: &impl Fn(DVec2, DVec2) -> bool,
) -> Vec<DVec2> {
    if line.len() < 3 {
        return line.to_vec();
    }
    let line = &refine(line);
    let kept = thin(line, clear);
    let mut points: Vec<DVec2> = kept.iter().map(|&i| line[i]).collect();
    let shift = relax(&mut points, metric, clear);
    let best = shorter(line, &kept, &points, metric);
    if shift > JUMP { search(best, metric, clear) } else { best }
}

/// The same line with points enough that no segment is longer than [`SEGMENT`].
fn refine(line: &[DVec2]) -> Vec<DVec2> {
    let pieces = line.windows(2).flat_map(|ends| {
        let count = (ends[0].distance(ends[1]) / SEGMENT - 1e-9).ceil().max(1.0);
        (0..count as usize).map(move |i| ends[0].lerp(ends[1], i as f64 / count))
    });
    pieces.chain(line.last().copied()).collect()
}

/// Indices of as few points as keep the segments clear and no longer than [`SEGMENT`].
fn thin(line: &[DVec2], clear: &impl Fn(DVec2, DVec2) -> bool) -> Vec<usize> {
    let last = line.len() - 1;
    let mut kept = vec![0];
    let mut from = line[0];
    for i in 1..last {
        let next = line[i + 1];
        if from.distance(next) > SEGMENT * (1.0 + 1e-9) || !clear(from, next) {
            kept.push(i);
            from = line[i];
        }
    }
    kept.push(last);
    kept
}

/// Between points that both lines share, the shorter of both by a finer quadrature than the one that was minimised.
fn shorter(
    line: &[DVec2],
    kept: &[usize],
    points: &[DVec2],
    metric: &impl Fn(DVec2) -> Sym2,
) -> Vec<DVec2> {
    let length = |line: &[DVec2]| fine_length(line, metric);
    let shared: Vec<usize> = (0..kept.len()).filter(|&k| points[k] == line[kept[k]]).collect();
    let mut best = vec![line[0]];
    for ends in shared.windows(2) {
        let old = &line[kept[ends[0]]..=kept[ends[1]]];
        let new = &points[ends[0]..=ends[1]];
        let pick = if length(new) < length(old) { new } else { old };
        best.extend(&pick[1..]);
    }
    best
}

/// Length by the finer quadrature.
pub(super) fn fine_length(line: &[DVec2], metric: &impl Fn(DVec2) -> Sym2) -> f64 {
    length_along(line, |at, by| metric(at).norm(by))
}

/// Unit normals of a line at its points, in grid coordinates.
fn normals(points: &[DVec2]) -> Vec<DVec2> {
    let last = points.len() - 1;
    (0..points.len())
        .map(|i| (points[last.min(i + 1)] - points[i.saturating_sub(1)]).perp().normalize_or_zero())
        .collect()
}
