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

/// The triangle between a node, an axis neighbour `a` and a diagonal neighbour `b` next to `a`.
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

    /// Which half of its cell it is. One that lies along the northern edge has 0, along the southern 2; plus 1 if along the eastern edge:
    ///
    /// ```text
    ///   1 ┌──┐      0 ┌──┐      2 │          3    │
    ///      ╲ │        │ ╱         │ ╲          ╱  │
    ///        │        │           └──┘       └────┘
    /// ```
    pub(crate) const fn half(self) -> usize {
        let (dx, dy) = RING[self.b];
        let (southern, eastern) = if self.along_y { (dy > 0, dx < 0) } else { (dy < 0, dx > 0) };
        (if southern { 2 } else { 0 }) + (if eastern { 1 } else { 0 })
    }
}

/// All eight, each followed by its point reflection through the node: the two have the same coefficients.
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

/// Evaluates the body for each of the [`TRIANGLES`]. Written out, since the compiler would unroll a loop too late to vectorise over nodes.
macro_rules! for_each_triangle {
    ($t:ident => $body:expr) => {
        for_each_triangle!(@ $t => $body, 0 1 2 3 4 5 6 7)
    };
    (@ $t:ident => $body:expr, $($k:literal)*) => {
        $({
            let $t = const { $crate::eikonal::stencil::ring::TRIANGLES[$k] };
            $body
        })*
    };
}
pub(crate) use for_each_triangle;

/// No corner cutting: the ring without the diagonal neighbours whose step passes between two closed nodes, through which it
/// would leak.
#[inline(always)]
pub(crate) fn without_cut_corners([e, se, s, sw, w, nw, n, ne]: [f32; 8]) -> [f32; 8] {
    [
        e,
        unless_cut(se, s, e),
        s,
        unless_cut(sw, s, w),
        w,
        unless_cut(nw, n, w),
        n,
        unless_cut(ne, n, e),
    ]
}

/// A diagonal neighbour; infinite where both axis neighbours of the node that are next to it are closed.
#[inline(always)]
fn unless_cut(diagonal: f32, a: f32, b: f32) -> f32 {
    if least(a, b) < f32::INFINITY { diagonal } else { f32::INFINITY }
}

/// The rings of [`LANES`](crate::linalg::lanes::LANES) consecutive nodes of the middle one of three lines, from `first` on: for each place of
/// the ring a number in each lane.
#[inline(always)]
pub(crate) fn rings<const N: usize>(
    [above, here, below]: [&[f32; N]; 3],
    first: usize,
) -> [Lanes; 8] {
    let (before, after) = (first - 1, first + 1);
    [
        lanes(here, after),
        lanes(below, after),
        lanes(below, first),
        lanes(below, before),
        lanes(here, before),
        lanes(above, before),
        lanes(above, first),
        lanes(above, after),
    ]
}

/// The ring of node `i` of them.
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
