//! Numbers that may carry their derivatives, so that a terrain's formula is written once.

use std::ops::{Add, Mul, Neg, Sub};

use crate::surface::HeightJet;

/// A number (`f64`) or a number with its first and second derivatives ([`Jet`]).
///
/// Transcendental functions come from `libm`, not from the platform, so that a terrain has the same
/// bits everywhere.
pub(super) trait Scalar:
    Copy
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Neg<Output = Self>
    + Add<f64, Output = Self>
    + Sub<f64, Output = Self>
    + Mul<f64, Output = Self>
{
    /// The number without its derivatives.
    fn value(self) -> f64;

    /// `f(self)`, where `[f, f′, f″]` are the values of `f` and its derivatives at [`value`](Self::value).
    fn chain(self, f: [f64; 3]) -> Self;

    fn sqrt(self) -> Self {
        let root = self.value().sqrt();
        self.chain([root, 0.5 / root, -0.25 / (root * self.value())])
    }

    fn exp(self) -> Self {
        self.chain([libm::exp(self.value()); 3])
    }

    fn sin(self) -> Self {
        let (sin, cos) = libm::sincos(self.value());
        self.chain([sin, cos, -sin])
    }

    fn cos(self) -> Self {
        let (sin, cos) = libm::sincos(self.value());
        self.chain([cos, -sin, -cos])
    }
}

impl Scalar for f64 {
    fn value(self) -> f64 {
        self
    }

    fn chain(self, [f, ..]: [f64; 3]) -> f64 {
        f
    }
}

/// A function of `(x, y)` at one point: value, gradient and Hessian, by forward differentiation.
#[derive(Clone, Copy)]
pub(super) struct Jet(HeightJet);

impl Jet {
    /// The two variables themselves, at `(x, y)`.
    pub(super) fn variables(x: f64, y: f64) -> (Self, Self) {
        (
            Self(HeightJet { z: x, zx: 1.0, ..HeightJet::default() }),
            Self(HeightJet { z: y, zy: 1.0, ..HeightJet::default() }),
        )
    }

    /// Value and derivatives.
    pub(super) fn get(self) -> HeightJet {
        self.0
    }

    /// Combines two jets term by term.
    fn zip(self, other: Self, f: impl Fn(f64, f64) -> f64) -> Self {
        let (a, b) = (self.0, other.0);
        Self(HeightJet {
            z: f(a.z, b.z),
            zx: f(a.zx, b.zx),
            zy: f(a.zy, b.zy),
            zxx: f(a.zxx, b.zxx),
            zxy: f(a.zxy, b.zxy),
            zyy: f(a.zyy, b.zyy),
        })
    }
}

impl Scalar for Jet {
    fn value(self) -> f64 {
        self.0.z
    }

    /// Faà di Bruno: `(f∘a)_ij = f′ a_ij + f″ a_i a_j`.
    fn chain(self, [f, f1, f2]: [f64; 3]) -> Self {
        let a = self.0;
        Self(HeightJet {
            z: f,
            zx: f1 * a.zx,
            zy: f1 * a.zy,
            zxx: f1 * a.zxx + f2 * a.zx * a.zx,
            zxy: f1 * a.zxy + f2 * a.zx * a.zy,
            zyy: f1 * a.zyy + f2 * a.zy * a.zy,
        })
    }
}

impl Add for Jet {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        self.zip(other, |a, b| a + b)
    }
}

impl Sub for Jet {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        self.zip(other, |a, b| a - b)
    }
}

impl Mul for Jet {
    type Output = Self;
    /// Leibniz: `(ab)_ij = a b_ij + a_i b_j + a_j b_i + a_ij b`.
    fn mul(self, other: Self) -> Self {
        let (a, b) = (self.0, other.0);
        Self(HeightJet {
            z: a.z * b.z,
            zx: a.zx * b.z + a.z * b.zx,
            zy: a.zy * b.z + a.z * b.zy,
            zxx: a.zxx * b.z + 2.0 * a.zx * b.zx + a.z * b.zxx,
            zxy: a.zxy * b.z + a.zx * b.zy + a.zy * b.zx + a.z * b.zxy,
            zyy: a.zyy * b.z + 2.0 * a.zy * b.zy + a.z * b.zyy,
        })
    }
}

impl Neg for Jet {
    type Output = Self;
    fn neg(self) -> Self {
        self * -1.0
    }
}

impl Add<f64> for Jet {
    type Output = Self;
    fn add(mut self, constant: f64) -> Self {
        self.0.z += constant;
        self
    }
}

impl Sub<f64> for Jet {
    type Output = Self;
    fn sub(mut self, constant: f64) -> Self {
        self.0.z -= constant;
        self
    }
}

impl Mul<f64> for Jet {
    type Output = Self;
    fn mul(self, factor: f64) -> Self {
        self.zip(self, |a, _| a * factor)
    }
}
