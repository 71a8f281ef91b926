//! The eight triangles around a node, mirrored onto one.

use super::super::update::{choose, greatest, least, pass};
use super::functional::{Quadratic, inverse_root};

/// The triangle between an axis neighbour `a` and a diagonal neighbour `b` of a node.
#[derive(Clone, Copy)]
pub(super) struct Triangle {
    /// Whether `a` lies towards smaller coordinates.
    pub(super) negative: bool,
    /// Whether `a` lies along y.
    pub(super) along_y: bool,
    /// Whether the diagonal is that of (1, −1).
    pub(super) falling: bool,
}

impl Triangle {
    const NEGATIVE: u32 = 1;
    pub(super) const ALONG_Y: u32 = 2;
    const FALLING: u32 = 4;
    /// Bits of no triangle: a node that is not corrected.
    pub(super) const NONE: u32 = 8;
    /// How many bits there are, and all of them.
    pub(super) const BITS: u32 = 4;
    pub(super) const ALL: u32 = 15;

    #[inline(always)]
    pub(super) fn from_bits(bits: u32) -> Self {
        Self {
            negative: bits & Self::NEGATIVE != 0,
            along_y: bits & Self::ALONG_Y != 0,
            falling: bits & Self::FALLING != 0,
        }
    }

    /// Whether `b` lies towards smaller coordinates from `a`.
    #[inline(always)]
    pub(super) fn backwards(self) -> bool {
        self.negative != self.falling
    }

    /// One of four values, by the place of `a`.
    #[inline(always)]
    pub(super) fn side(self, east: f32, south: f32, west: f32, north: f32) -> f32 {
        choose(self.along_y, choose(self.negative, north, south), choose(self.negative, west, east))
    }

    /// Of the values around the node in the order of [`RING`](super::super::update::RING) that at `a`.
    #[inline(always)]
    pub(super) fn axis(self, ring: [f32; 8]) -> f32 {
        self.side(ring[0], ring[2], ring[4], ring[6])
    }

    /// That at `b`.
    #[inline(always)]
    pub(super) fn diagonal(self, ring: [f32; 8]) -> f32 {
        let rising = choose(self.negative, ring[5], ring[1]);
        let falling = choose(self.negative != self.along_y, ring[3], ring[7]);
        choose(self.falling, falling, rising)
    }

    /// That at the other diagonal neighbour beside `a`.
    #[inline(always)]
    pub(super) fn opposite(self, ring: [f32; 8]) -> f32 {
        Self { falling: !self.falling, ..self }.diagonal(ring)
    }

    /// `M` mirrored with the triangle onto that between (1, 0) and (1, 1).
    #[inline(always)]
    pub(super) fn mirror(self, [xx, xy, yy]: [f32; 3]) -> Quadratic {
        Quadratic(
            choose(self.along_y, yy, xx),
            choose(self.falling, -xy, xy),
            choose(self.along_y, xx, yy),
        )
    }

    /// A place mirrored likewise.
    #[inline(always)]
    pub(super) fn mirror_place(self, [x, y]: [f32; 2]) -> [f32; 2] {
        let (along, across) = (choose(self.along_y, y, x), choose(self.along_y, x, y));
        [choose(self.negative, -along, along), choose(self.backwards(), -across, across)]
    }

    /// The triangle that gives a node its first-order value, as bits, and the difference `g(b) − g(a)` there, from the
    /// values around the node and `M` with its determinant. See
    /// [`Coefficients`](super::super::update::Coefficients), there in terms of `D`. Roots to five digits: of two triangles
    /// that are as good as each other either will do.
    #[inline(always)]
    pub(super) fn best(ring: [f32; 8], [xx, xy, yy]: [f32; 3], det: f32) -> (u32, f32) {
        let (rising2, falling2) =
            (greatest(xx + yy + 2.0 * xy, 1e-30), greatest(xx + yy - 2.0 * xy, 1e-30));
        let (irising, ifalling) = (inverse_root(rising2), inverse_root(falling2));
        let (rising, falling) = (rising2 * irising, falling2 * ifalling);
        let (ieast, isouth) = (inverse_root(xx), inverse_root(yy));
        let (rx, ry) = (isouth * isouth, ieast * ieast);
        // `1/s`, `det D/s²`, `β/s` and `hi` of the triangles along x and y; `β` and `hi` with the other sign if falling.
        let x = [det * rx, det * rx * rx, -xy * rx, -xy * ieast];
        let y = [det * ry, det * ry * ry, -xy * ry, -xy * isouth];
        let fallen = |[i, e, beta, hi]: [f32; 4]| [i, e, -beta, -hi];
        let (lo_x, lo_y) = (-(xy + yy) * irising, -(xy + xx) * irising);
        let (fallen_lo_x, fallen_lo_y) = ((xy - yy) * ifalling, (xy - xx) * ifalling);
        let [e, se, s, sw, w, nw, n, ne] = ring;
        let (se, nw) = (pass(se, s, e), pass(nw, n, w));
        let (ne, sw) = (pass(ne, n, e), pass(sw, s, w));
        let (mut least_value, mut triangle, mut slope) = (f32::INFINITY, 0, 0.0);
        let mut offer = |t: u32, a: f32, b: f32, lo: f32, [i, e, beta, hi]: [f32; 4], step: f32| {
            let d = b - a;
            let c = greatest(least(d, hi), lo);
            let between = a + (beta * c + greatest(i - e * (c * c), 0.0).sqrt());
            let value = choose(d < lo, b + step, between);
            let better = value < least_value;
            least_value = choose(better, value, least_value);
            slope = choose(better, d, slope);
            triangle = if better { t } else { triangle };
        };
        let (neg, y_, fall) = (Self::NEGATIVE, Self::ALONG_Y, Self::FALLING);
        offer(0, e, se, lo_x, x, rising);
        offer(neg, w, nw, lo_x, x, rising);
        offer(y_, s, se, lo_y, y, rising);
        offer(y_ | neg, n, nw, lo_y, y, rising);
        offer(fall, e, ne, fallen_lo_x, fallen(x), falling);
        offer(fall | neg, w, sw, fallen_lo_x, fallen(x), falling);
        offer(fall | y_, s, sw, fallen_lo_y, fallen(y), falling);
        offer(fall | y_ | neg, n, ne, fallen_lo_y, fallen(y), falling);
        (triangle, slope)
    }
}
