//! Dynamic programming over the lines on both sides of a line.

use glam::DVec2;

use super::{MOST_STEPS, fine_length, normals, refine};
use crate::linalg::Sym2;

/// Steps of the search in cells. The finer ones are of no use before the coarser.
const STRIDES: [f64; 5] = [1.0, 0.5, 0.25, 0.125, 0.0625];
/// A search that shortens the line by less than this share goes on with the next stride.
const WORTH: f64 = 1e-4;

/// The line moved sideways by ever smaller steps, each time to the best of the lines on both sides of it.
pub(super) fn search(
    mut line: Vec<DVec2>,
    metric: &impl Fn(DVec2) -> Sym2,
    clear: &impl Fn(DVec2, DVec2) -> bool,
) -> Vec<DVec2> {
    let mut least = fine_length(&line, metric);
    for stride in STRIDES {
        line = refine(&line);
        for _ in 0..MOST_STEPS {
            let (length, moved) = best_displaced(&line, stride, metric, clear);
            if length.is_nan() || length >= (1.0 - WORTH) * least {
                break;
            }
            (least, line) = (length, moved);
        }
    }
    line
}

/// The shortest of the lines whose points each stay or go a stride to either side, and its length: the best path to each
/// candidate of a point goes by the best path to a candidate of the point before it.
fn best_displaced(
    line: &[DVec2],
    stride: f64,
    metric: &impl Fn(DVec2) -> Sym2,
    clear: &impl Fn(DVec2, DVec2) -> bool,
) -> (f64, Vec<DVec2>) {
    let last = line.len() - 1;
    let mut strides: Vec<DVec2> = normals(line).iter().map(|normal| normal * stride).collect();
    (strides[0], strides[last]) = (DVec2::ZERO, DVec2::ZERO);
    let candidates = |i: usize| candidates(line[i], strides[i]);
    let mut lengths = [0.0; 3];
    let mut predecessors = Vec::with_capacity(last);
    for i in 1..line.len() {
        let (from, to) = (candidates(i - 1), candidates(i));
        let best = [0, 1, 2].map(|k| {
            let paths = [0, 1, 2].map(|j| match (j, k) == (STAY, STAY) || clear(from[j], to[k]) {
                true => lengths[j] + fine_length(&[from[j], to[k]], metric),
                false => f64::INFINITY,
            });
            let least = (1..3).fold(0, |best, j| if paths[j] < paths[best] { j } else { best });
            (paths[least], least)
        });
        lengths = best.map(|(length, _)| length);
        predecessors.push(best.map(|(_, predecessor)| predecessor));
    }
    let mut candidate = STAY;
    let mut moved = vec![line[last]];
    for (i, predecessors) in predecessors.iter().enumerate().rev() {
        candidate = predecessors[candidate];
        moved.push(candidates(i)[candidate]);
    }
    moved.reverse();
    (lengths[STAY], moved)
}

/// The first of the [`candidates`] of a point: always allowed, and the best where nothing is gained.
const STAY: usize = 0;

/// Where a point may go: it stays, or moves a stride to either side.
fn candidates(point: DVec2, stride: DVec2) -> [DVec2; 3] {
    [0.0, 1.0, -1.0].map(|side| point + stride * side)
}
