//! The ring of eight neighbours around a node, and the eight triangles that it makes with the node.

use crate::linalg::lanes::{Lanes, lanes, least};

/// The ring in index coordinates (x along columns, y along rows), axis neighbours at even places:
///
/// ```text
///   5 ── 6 ── 7
///   │  ╲ │ ╱  │         ──▶ x
///   4 ── · ── 0         │
///   │  ╱ │ ╲  │         ▼ y
///   3 ── 2 ── 1
/// ```
pub(crate) const RING: [(i32, i32); 8] =
    [(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1)];

/// The triangle between a node, an axis neighbour `a` and a diagonal neighbour `b` beside that.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Triangle {
    /// Place of `a` on the ring.
    pub(crate) a: usize,
    /// Place of `b`.
    pub(crate) b: usize,
    /// Whether `a` lies along y.
    pub(crate) along_y: bool,
    /// Whether `a` lies towards smaller coordinates.
    pub(crate) negative: bool,
    /// Whether `b` lies on the diagonal of (1, −1), where one coordinate falls as the other rises.
    pub(crate) falling: bool,
}

impl Triangle {
    pub(crate) const fn new(a: usize, b: usize) -> Self {
        let ((ax, ay), (bx, by)) = (RING[a], RING[b]);
        Self { a, b, along_y: ax == 0, negative: ax + ay < 0, falling: bx != by }
    }
}

/// All eight, each beside the one that mirrors it in the node: the two have the same `D` and the same coefficients.
pub(crate) const TRIANGLES: [Triangle; 8] = [
    Triangle::new(0, 1),
    Triangle::new(4, 5),
    Triangle::new(2, 1),
    Triangle::new(6, 5),
    Triangle::new(0, 7),
    Triangle::new(4, 3),
    Triangle::new(2, 3),
    Triangle::new(6, 7),
];

/// No corner cutting: the ring without the diagonal neighbours whose step passes between two closed nodes, through which it
/// would leak.
#[inline(always)]
pub(crate) fn without_cut_corners(ring: [f32; 8]) -> [f32; 8] {
    let mut seen = ring;
    for axis in [0, 2, 4, 6] {
        let (diagonal, next) = (axis + 1, (axis + 2) % 8);
        let is_seen = least(ring[axis], ring[next]) < f32::INFINITY;
        seen[diagonal] = if is_seen { ring[diagonal] } else { f32::INFINITY };
    }
    seen
}

/// The rings of [`LANES`](crate::linalg::lanes::LANES) nodes side by side, place by place: those of the middle one of three lines, from
/// the one at `first` on.
#[inline(always)]
pub(crate) fn rings<const N: usize>(lines: [&[f32; N]; 3], first: usize) -> [Lanes; 8] {
    let mut rings = [[0.0; 16]; 8];
    for k in 0..8 {
        let (dx, dy) = RING[k];
        let line = lines[(1 + dy) as usize];
        rings[k] = lanes(line, (first as i32 + dx) as usize);
    }
    rings
}

/// The ring of one of them.
#[inline(always)]
pub(crate) fn ring_of([e, se, s, sw, w, nw, n, ne]: &[Lanes; 8], i: usize) -> [f32; 8] {
    [e[i], se[i], s[i], sw[i], w[i], nw[i], n[i], ne[i]]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_triangles_cover_the_ring() {
        for Triangle { a, b, along_y, negative, falling } in TRIANGLES {
            let ((ax, ay), (bx, by)) = (RING[a], RING[b]);
            assert_eq!((ax - bx).abs() + (ay - by).abs(), 1, "neighbours on the ring");
            assert_eq!(along_y, ay != 0);
            assert_eq!(negative, ax < 0 || ay < 0);
            assert_eq!(falling, bx == -by);
        }
        for place in 0..8 {
            let touching = TRIANGLES.iter().filter(|t| t.a == place || t.b == place);
            assert_eq!(touching.count(), 2);
        }
    }

    #[test]
    fn a_step_between_two_closed_nodes_is_hidden() {
        let closed = f32::INFINITY;
        let ring = [closed, 1.0, closed, 3.0, 4.0, 5.0, 6.0, 7.0];
        assert_eq!(without_cut_corners(ring), [closed, closed, closed, 3.0, 4.0, 5.0, 6.0, 7.0]);
    }
}
