//! Small linear algebra that every stage uses.

pub(crate) mod lanes;
mod sym2;

pub use self::sym2::Sym2;
