//! The eight triangles around a node, mirrored onto one.

use super::super::stencil::ring::pass;
use super::functional::{Quadratic, inverse_root};
use crate::linalg::lanes::{greatest, least};

/// Yes or no, as the bits of a lane: all set or none.
///
/// Values are chosen bit by bit. A branch between values in memory becomes one between their addresses, and the loop around it is not
/// vectorised without gathers: for AVX2 high accuracy took 2.5 times as long.
#[derive(Clone, Copy)]
pub(super) struct Mask(u32);

impl Mask {
    /// Whether a bit of `bits` is set.
    #[inline(always)]
    fn of(bits: u32, bit: u32) -> Self {
        Self(((bits << (31 - bit.trailing_zeros())) as i32 >> 31) as u32)
    }

    #[inline(always)]
    pub(super) fn choose(self, yes: f32, no: f32) -> f32 {
        f32::from_bits(yes.to_bits() & self.0 | no.to_bits() & !self.0)
    }

    /// `value`, negated if yes.
    #[inline(always)]
    fn negate(self, value: f32) -> f32 {
        f32::from_bits(value.to_bits() ^ (self.0 & 1 << 31))
    }

    #[inline(always)]
    fn differs(self, other: Self) -> Self {
        Self(self.0 ^ other.0)
    }

    #[inline(always)]
    pub(super) fn is_yes(self) -> bool {
        self.0 != 0
    }
}

/// As [`Mask::choose`]: unlike the one of `update.rs` never a branch.
#[inline(always)]
pub(super) fn choose(yes: bool, a: f32, b: f32) -> f32 {
    Mask(0u32.wrapping_sub(u32::from(yes))).choose(a, b)
}

/// The triangle between an axis neighbour `a` and a diagonal neighbour `b` of a node.
#[derive(Clone, Copy)]
pub(super) struct Triangle {
    /// Whether `a` lies towards smaller coordinates.
    pub(super) negative: Mask,
    /// Whether `a` lies along y.
    pub(super) along_y: Mask,
    /// Whether the diagonal is that of (1, −1).
    pub(super) falling: Mask,
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

    /// One of four values, by the place of `a`.
    #[inline(always)]
    pub(super) fn side(self, east: f32, south: f32, west: f32, north: f32) -> f32 {
        let Self { negative, along_y, .. } = self;
        along_y.choose(negative.choose(north, south), negative.choose(west, east))
    }

    /// Of the values around the node in the order of [`RING`](super::super::stencil::ring::RING) that at `a`.
    #[inline(always)]
    pub(super) fn axis(self, ring: [f32; 8]) -> f32 {
        self.side(ring[0], ring[2], ring[4], ring[6])
    }

    /// Those at `b` and at the other diagonal neighbour beside `a`.
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

    /// A place mirrored likewise.
    #[inline(always)]
    pub(super) fn mirror_place(self, [x, y]: [f32; 2]) -> [f32; 2] {
        let (along, across) = (self.along_y.choose(y, x), self.along_y.choose(x, y));
        [self.negative.negate(along), self.backwards().negate(across)]
    }

    /// The triangle that gives a node its first-order value, as bits, and the difference `g(b) − g(a)` there, from the
    /// values around the node and `M` with its determinant. See
    /// [`Coefficients`](super::super::tile::coefficients::Coefficients), there in terms of `D`. Roots to five digits: of two triangles
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
