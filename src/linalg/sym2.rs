//! Symmetric 2×2 matrices.

use std::ops::{Add, Mul};

use glam::DVec2;

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

impl Sym2 {
    /// All entries NaN: no matrix.
    pub const NAN: Self = Self::new(f64::NAN, f64::NAN, f64::NAN);

    /// `[xx xy; xy yy]`.
    #[must_use]
    #[inline(always)]
    pub const fn new(xx: f64, xy: f64, yy: f64) -> Self {
        Self { xx, xy, yy }
    }

    /// The outer product `v vᵀ`.
    #[must_use]
    pub fn outer(v: DVec2) -> Self {
        Self::new(v.x * v.x, v.x * v.y, v.y * v.y)
    }

    /// Determinant.
    #[must_use]
    #[inline(always)]
    pub fn det(self) -> f64 {
        self.xx * self.yy - self.xy * self.xy
    }

    /// Inverse; not finite if the matrix is singular.
    #[must_use]
    #[inline(always)]
    pub fn inverse(self) -> Self {
        Self::new(self.yy, -self.xy, self.xx) * self.det().recip()
    }

    /// `A v`.
    #[must_use]
    #[inline(always)]
    pub fn apply(self, v: DVec2) -> DVec2 {
        DVec2::new(self.xx * v.x + self.xy * v.y, self.xy * v.x + self.yy * v.y)
    }

    /// The quadratic form `vᵀ A v`.
    #[must_use]
    pub fn form(self, v: DVec2) -> f64 {
        v.dot(self.apply(v))
    }

    /// `√(vᵀ A v)`: the length of `v` under the metric `A`.
    #[must_use]
    pub fn norm(self, v: DVec2) -> f64 {
        self.form(v).max(0.0).sqrt()
    }

    /// `diag(s) A diag(s)`: the same form in coordinates rescaled by `s`.
    #[must_use]
    pub fn rescale(self, s: DVec2) -> Self {
        Self::new(self.xx * s.x * s.x, self.xy * s.x * s.y, self.yy * s.y * s.y)
    }

    /// The congruence `P A P` for a symmetric `P`.
    #[must_use]
    #[inline(always)]
    pub fn congruence(self, p: Self) -> Self {
        let (a, b) = (self.apply(DVec2::new(p.xx, p.xy)), self.apply(DVec2::new(p.xy, p.yy)));
        let (a, b) = (p.apply(a), p.apply(b));
        Self::new(a.x, a.y, b.y)
    }

    /// Whether the matrix is finite, symmetric positive definite.
    #[must_use]
    pub fn is_positive_definite(self) -> bool {
        // With a positive diagonal, a finite determinant excludes infinite and NaN entries.
        self.xx > 0.0 && self.yy > 0.0 && self.det() > 0.0 && self.det().is_finite()
    }
}

impl Add for Sym2 {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self::new(self.xx + other.xx, self.xy + other.xy, self.yy + other.yy)
    }
}

impl Mul<f64> for Sym2 {
    type Output = Self;
    #[inline(always)]
    fn mul(self, factor: f64) -> Self {
        Self::new(self.xx * factor, self.xy * factor, self.yy * factor)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn algebra_agrees_with_matrices() {
        let a = Sym2::new(2.0, 0.5, 1.0);
        let v = DVec2::new(0.3, -0.7);
        assert!((a.inverse().apply(a.apply(v)) - v).length() < 1e-14);
        assert!((a.norm(v) - v.dot(a.apply(v)).sqrt()).abs() < 1e-15);
        assert!(a.is_positive_definite() && !Sym2::new(1.0, 2.0, 1.0).is_positive_definite());
        assert!(!Sym2::new(f64::INFINITY, 0.0, 1.0).is_positive_definite());
        assert!(!Sym2::new(f64::NAN, 0.0, 1.0).is_positive_definite());
    }
}
