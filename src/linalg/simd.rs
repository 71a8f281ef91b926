//! Hot loops compiled for several instruction sets; the best that the machine has is chosen at run time.
//!
//! Plain Rust over arrays of [`LANES`](super::lanes::LANES) numbers, which the compiler turns into vector instructions. None of them is a
//! fused multiply-add, so that all instruction sets give the same bits.

use multiversion::multiversion;

/// A hot loop with its arguments.
pub(crate) trait Kernel {
    /// Its result.
    type Output;

    /// Runs the loop. Must be `#[inline(always)]`, as must all that it calls: what is not inlined is compiled for the baseline only.
    fn run(self) -> Self::Output;
}

/// Runs a kernel, compiled for the widest registers that the machine has.
///
/// Choosing costs a load and a jump.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512cd+avx512dq+avx512vl", "x86_64+avx2"))]
pub(crate) fn dispatch<K: Kernel>(kernel: K) -> K::Output {
    kernel.run()
}
