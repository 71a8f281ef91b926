//! Arrays of numbers that the compiler keeps in the lanes of vector registers.

/// As many `f32` as an AVX-512 register holds.
pub(crate) const LANES: usize = 16;

/// A number in each lane.
pub(crate) type Lanes = [f32; LANES];

/// [`LANES`] consecutive numbers of a line, from `first` on.
#[inline(always)]
pub(crate) fn lanes(line: &[f32], first: usize) -> Lanes {
    // Not `array::from_fn` or an iterator: what is not inlined is not compiled for the wide registers.
    let mut lanes = [0.0; LANES];
    lanes.copy_from_slice(&line[first..first + LANES]);
    lanes
}

#[inline(always)]
pub(crate) fn choose(condition: bool, a: f32, b: f32) -> f32 {
    if condition { a } else { b }
}

/// The smaller of two numbers; compiles to one instruction because it does not care for NaN.
#[inline(always)]
pub(crate) fn least(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// The greater of two numbers, in the same way.
#[inline(always)]
pub(crate) fn greatest(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// `1/√x` to five digits, by the well-known estimate from the bits of `x` and two Newton steps; takes a fraction of the time of a
/// root and a division, and gives the same on every machine.
#[inline(always)]
pub(crate) fn inverse_root(x: f32) -> f32 {
    let mut y = f32::from_bits(0x5f37_59df - (x.to_bits() >> 1));
    for _ in 0..2 {
        y *= 1.5 - 0.5 * x * y * y;
    }
    y
}

/// A condition as the bits of a lane: all set if true, none if false.
///
/// Values are chosen by bit operations. The compiler turns a branch between values in memory into one between their addresses, which
/// vectorises only with gather instructions: on AVX2 high accuracy took 2.5 times as long.
#[derive(Clone, Copy)]
pub(crate) struct Mask(u32);

impl Mask {
    /// Of two conditions the first if this one is true.
    #[inline(always)]
    pub(crate) fn select(self, a: Self, b: Self) -> Self {
        Self((self.0 & a.0) | (!self.0 & b.0))
    }

    /// Whether `bit`, a power of two, is set in `bits`.
    #[inline(always)]
    pub(crate) fn of(bits: u32, bit: u32) -> Self {
        Self(((bits << (31 - bit.trailing_zeros())) as i32 >> 31) as u32)
    }

    #[inline(always)]
    pub(crate) fn choose(self, if_true: f32, if_false: f32) -> f32 {
        f32::from_bits(if_true.to_bits() & self.0 | if_false.to_bits() & !self.0)
    }

    /// `value`, negated where true.
    #[inline(always)]
    pub(crate) fn negate(self, value: f32) -> f32 {
        f32::from_bits(value.to_bits() ^ (self.0 & 1 << 31))
    }

    #[inline(always)]
    pub(crate) fn differs(self, other: Self) -> Self {
        Self(self.0 ^ other.0)
    }

    #[inline(always)]
    pub(crate) fn is_true(self) -> bool {
        self.0 != 0
    }
}

/// As [`choose`], but never a branch: see [`Mask`].
#[inline(always)]
pub(crate) fn choose_bits(condition: bool, a: f32, b: f32) -> f32 {
    Mask(0u32.wrapping_sub(u32::from(condition))).choose(a, b)
}
