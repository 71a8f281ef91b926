//! Walls: `n × n` nodes, row by row, `true` where closed. The middle is open.

use std::f64::consts::TAU;

use super::Random;

/// Places of the maze along a side; odd, so that the middle is inside one.
const PLACES: usize = 25;
/// Nodes that a wall of the maze is thick.
const THICK: usize = 3;

/// A spanning tree of a square of [`PLACES`]² places by random depth-first search from the middle.
pub(super) fn maze(n: usize) -> Vec<bool> {
    let (east_open, south_open) = ways();
    let place = |i: usize| (i * PLACES / n).min(PLACES - 1);
    // The last nodes of a place, before the next one begins, are wall.
    let at_end = |i: usize| place(i) + 1 < PLACES && place((i + THICK).min(n - 1)) > place(i);
    let closed = |i: usize| {
        let (col, row) = (i % n, i / n);
        let at = place(row) * PLACES + place(col);
        match (at_end(col), at_end(row)) {
            (true, true) => true,
            (true, false) => !east_open[at],
            (false, true) => !south_open[at],
            (false, false) => false,
        }
    };
    (0..n * n).map(closed).collect()
}

/// Whether one can go from each place to the one east and to the one south of it.
fn ways() -> (Vec<bool>, Vec<bool>) {
    let mut random = Random(11);
    let mut east = vec![false; PLACES * PLACES];
    let mut south = east.clone();
    let mut seen = east.clone();
    let mut way = vec![PLACES * PLACES / 2];
    seen[way[0]] = true;
    while let Some(&here) = way.last() {
        let (col, row) = (here % PLACES, here / PLACES);
        let mut next = Vec::with_capacity(4);
        let mut offer = |inside: bool, there: usize| {
            if inside && !seen[there] {
                next.push(there);
            }
        };
        offer(col + 1 < PLACES, here + 1);
        offer(col > 0, here.wrapping_sub(1));
        offer(row + 1 < PLACES, here + PLACES);
        offer(row > 0, here.wrapping_sub(PLACES));
        if next.is_empty() {
            way.pop();
            continue;
        }
        let there = next[random.below(next.len())];
        let (first, open) = if here.abs_diff(there) == 1 {
            (here.min(there), &mut east)
        } else {
            (here.min(there), &mut south)
        };
        open[first] = true;
        seen[there] = true;
        way.push(there);
    }
    (east, south)
}

/// An Archimedean spiral wall of twelve turns round an open middle.
pub(super) fn spiral(n: usize) -> Vec<bool> {
    /// Turns from the middle of a side to the middle of the square, and the share of a passage that is wall.
    const TURNS: f64 = 12.0;
    const WALL: f64 = 0.15;
    let middle = 0.5 * (n - 1) as f64;
    let closed = |i: usize| {
        let (x, y) = ((i % n) as f64 - middle, (i / n) as f64 - middle);
        let radius = x.hypot(y) / middle;
        let turn = radius * TURNS - y.atan2(x) / TAU;
        (0.1..0.97).contains(&radius) && turn.rem_euclid(1.0) < WALL
    };
    (0..n * n).map(closed).collect()
}
