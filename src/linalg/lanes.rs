//! Numbers side by side, one in each lane of a wide register.

/// As many `f32` as an AVX-512 register holds.
pub(crate) const LANES: usize = 16;

/// A number in each lane.
pub(crate) type Lanes = [f32; LANES];

/// [`LANES`] numbers of a line, from `first` on.
#[inline(always)]
pub(crate) fn lanes(line: &[f32], first: usize) -> Lanes {
    // Not `array::from_fn` or an iterator: what is not inlined here is not compiled for the wide registers.
    let mut lanes = [0.0; LANES];
    lanes.copy_from_slice(&line[first..first + LANES]);
    lanes
}

#[inline(always)]
pub(crate) fn choose(yes: bool, a: f32, b: f32) -> f32 {
    if yes { a } else { b }
}

/// The smaller of two; compiles to one instruction because NaN is not its business.
#[inline(always)]
pub(crate) fn least(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// The greater of two, likewise.
#[inline(always)]
pub(crate) fn greatest(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}
