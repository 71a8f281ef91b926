//! Small linear algebra that every stage uses, and the means to vectorise hot loops.

pub(crate) mod bilinear;
pub(crate) mod lanes;
pub(crate) mod simd;
mod sym2;

pub use self::sym2::Sym2;
