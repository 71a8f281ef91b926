//! Symmetric 2×2 matrices.

/// `[xx xy; xy yy]`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sym2 {
    /// First diagonal entry.
    pub xx: f64,
    /// Off-diagonal entry.
    pub xy: f64,
    /// Second diagonal entry.
    pub yy: f64,
}
