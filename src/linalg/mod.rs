//! Small linear algebra that every stage uses.

mod sym2;

pub use self::sym2::Sym2;
