//! The eight triangles around a node, mirrored onto one; each lane may have a different triangle.

#![allow(clippy::needless_range_loop, reason = "lanes of several arrays go together")]

use super::functional::Quadratic;
use crate::eikonal::stencil::ring::{RING, Triangle, for_each_triangle, without_cut_corners};
use crate::eikonal::stencil::segment::ClosedForm;
use crate::eikonal::tile::coefficients::{CellLine, LineCosts, cell_of};
use crate::linalg::lanes::{Mask, choose_bits as choose, greatest, inverse_root};

/// The best triangle so far, as bits, and the difference along its segment.
struct Best {
    value: f32,
    triangle: u32,
    slope: f32,
}

/// A [`Triangle`] in a lane.
#[derive(Clone, Copy)]
pub(super) struct LaneTriangle {
    /// Whether `a` lies towards smaller coordinates.
    pub(super) negative: Mask,
    /// Whether `a` lies along y.
    pub(super) along_y: Mask,
    /// Whether the diagonal is that of (1, −1).
    pub(super) falling: Mask,
}

impl LaneTriangle {
    const NEGATIVE: u32 = 1;
    pub(super) const ALONG_Y: u32 = 2;
    const FALLING: u32 = 4;
    /// Bits of no triangle: a node that is not corrected.
    pub(super) const NONE: u32 = 8;
    /// How many bits there are, and all of them.
    pub(super) const BITS: u32 = 4;
    pub(super) const ALL: u32 = 15;

    /// The bits of a triangle.
    #[inline(always)]
    fn to_bits(t: Triangle) -> u32 {
        let negative = if t.negative { Self::NEGATIVE } else { 0 };
        let along_y = if t.along_y { Self::ALONG_Y } else { 0 };
        let falling = if t.falling { Self::FALLING } else { 0 };
        negative | along_y | falling
    }

    #[inline(always)]
    pub(super) fn from_bits(bits: u32) -> Self {
        Self {
            negative: Mask::of(bits, Self::NEGATIVE),
            along_y: Mask::of(bits, Self::ALONG_Y),
            falling: Mask::of(bits, Self::FALLING),
        }
    }

    /// Whether `b` lies towards smaller coordinates from `a`.
    #[inline(always)]
    pub(super) fn backwards(self) -> Mask {
        self.negative.differs(self.falling)
    }

    /// Of the values in the cells around the node (north-west, north-east, south-west, south-east) that in the cell of the triangle, and
    /// that in the cell on the other side of the edge to `a`.
    #[inline(always)]
    pub(super) fn cells(self, [nw, ne, sw, se]: [f32; 4]) -> [f32; 2] {
        let Self { negative, along_y, .. } = self;
        let backwards = self.backwards();
        let west = along_y.select(backwards, negative);
        let (north, south) = (west.choose(nw, ne), west.choose(sw, se));
        let (north_beside, south_beside) = (west.choose(ne, nw), west.choose(se, sw));
        // Along x the cell beside is the one across the row, along y the one across the column.
        let along_x = [backwards.choose(north, south), backwards.choose(south, north)];
        let other = [negative.choose(north, south), negative.choose(north_beside, south_beside)];
        [along_y.choose(other[0], along_x[0]), along_y.choose(other[1], along_x[1])]
    }

    /// One of four values, by the place of `a`.
    #[inline(always)]
    pub(super) fn side(self, east: f32, south: f32, west: f32, north: f32) -> f32 {
        let Self { negative, along_y, .. } = self;
        along_y.choose(negative.choose(north, south), negative.choose(west, east))
    }

    /// Of the values around the node in the order of [`RING`](crate::eikonal::stencil::ring::RING) that at `a`.
    #[inline(always)]
    pub(super) fn axis(self, ring: [f32; 8]) -> f32 {
        self.side(ring[0], ring[2], ring[4], ring[6])
    }

    /// Those at `b` and at the other diagonal neighbour next to `a`.
    #[inline(always)]
    pub(super) fn diagonals(self, [_, se, _, sw, _, nw, _, ne]: [f32; 8]) -> [f32; 2] {
        let rising = self.negative.choose(nw, se);
        let falling = self.negative.differs(self.along_y).choose(sw, ne);
        [self.falling.choose(falling, rising), self.falling.choose(rising, falling)]
    }

    /// `M` mirrored with the triangle onto that between (1, 0) and (1, 1).
    #[inline(always)]
    pub(super) fn mirror(self, [xx, xy, yy]: [f32; 3]) -> Quadratic {
        let along_y = self.along_y;
        Quadratic(along_y.choose(yy, xx), self.falling.negate(xy), along_y.choose(xx, yy))
    }

    /// A vector mirrored likewise.
    #[inline(always)]
    pub(super) fn mirror_vector(self, [x, y]: [f32; 2]) -> [f32; 2] {
        let (along, across) = (self.along_y.choose(y, x), self.along_y.choose(x, y));
        [self.negative.negate(along), self.backwards().negate(across)]
    }

    /// The triangle that gives a node its first-order value, as bits, and the difference `g(b) − g(a)` there, from the
    /// values around the node and its `M` with its determinant, where steps are priced by that. See [`ClosedForm`], here in terms of `M`: `D = [s β; β q]` is
    /// `[yy −xy; −xy xx]/det M`. Roots to five digits: of two triangles that are as good as each other either will do.
    #[inline(always)]
    pub(super) fn best_by_node(ring: [f32; 8], [xx, xy, yy]: [f32; 3], det: f32) -> (u32, f32) {
        let (rising2, falling2) =
            (greatest(xx + yy + 2.0 * xy, 1e-30), greatest(xx + yy - 2.0 * xy, 1e-30));
        let (inv_rising, inv_falling) = (inverse_root(rising2), inverse_root(falling2));
        let (rising, falling) = (rising2 * inv_rising, falling2 * inv_falling);
        let (inv_east, inv_south) = (inverse_root(xx), inverse_root(yy));
        let ring = without_cut_corners(ring);
        let mut best = Best { value: f32::INFINITY, triangle: 0, slope: 0.0 };
        for_each_triangle!(t => {
            // aᵀMw, 1/‖a‖ and 1/‖w‖, ‖b‖ and 1/‖b‖.
            let aw = if t.falling { -xy } else { xy };
            let ww = if t.along_y { xx } else { yy };
            let [inv_a, inv_w] =
                if t.along_y { [inv_south, inv_east] } else { [inv_east, inv_south] };
            let [step, inv_step] =
                if t.falling { [falling, inv_falling] } else { [rising, inv_rising] };
            let inv_ww = inv_w * inv_w;
            let form = ClosedForm {
                inv_s: det * inv_ww,
                det_over_s2: det * inv_ww * inv_ww,
                beta_over_s: -aw * inv_ww,
                lo: -(aw + ww) * inv_step,
                hi: -aw * inv_a,
            };
            let (ga, gb) = (ring[t.a], ring[t.b]);
            let d = gb - ga;
            let value = choose(d < form.lo, gb + step, form.through(ga, gb));
            let better = value < best.value;
            best.value = choose(better, value, best.value);
            best.slope = choose(better, d, best.slope);
            best.triangle = if better { Self::to_bits(t) } else { best.triangle };
        });
        (best.triangle, best.slope)
    }

    /// The triangle that gives node `i` of a line its first-order value, as bits, and the difference `g(b) − g(a)` there, from the
    /// values around the node.
    #[inline(always)]
    pub(super) fn best<const T: usize>(
        ring: [f32; 8],
        cells: [&CellLine<T>; 2],
        costs: &LineCosts,
        i: usize,
    ) -> (u32, f32) {
        let ring = without_cut_corners(ring);
        let mut best = Best { value: f32::INFINITY, triangle: 0, slope: 0.0 };
        for_each_triangle!(t => {
            let (line, cell) = cell_of::<false>(RING[t.b], i);
            let (ga, gb) = (ring[t.a], ring[t.b]);
            let weights = [costs.own[i], costs.ring[t.a][i], costs.ring[t.b][i]];
            let value = cells[line].through(t, cell, [ga, gb], weights);
            let better = value < best.value;
            best.value = choose(better, value, best.value);
            best.slope = choose(better, gb - ga, best.slope);
            best.triangle = if better { Self::to_bits(t) } else { best.triangle };
        });
        (best.triangle, best.slope)
    }
}
