//! Symmetric positive definite band matrices: factored once, solved for many right-hand sides.

use super::basis::SUPPORT;
use crate::linalg::simd::{self, Kernel};

/// A symmetric band matrix; `rows[i][d]` is the entry at `(i, i − d)`.
#[derive(Clone, Debug)]
pub(in crate::surface) struct Banded {
    rows: Vec<[f64; SUPPORT]>,
}

/// The factors `L D Lᵀ` of a [`Banded`], `L` with a unit diagonal.
#[derive(Clone, Debug)]
pub(in crate::surface) struct Ldl {
    /// `lower[i][d]` is `L` at `(i, i − d)`; `lower[i][0]` holds `1/D_i`.
    lower: Vec<[f64; SUPPORT]>,
    band: usize,
}

impl Banded {
    /// The zero matrix of order `n`.
    pub(in crate::surface) fn zero(n: usize) -> Self {
        Self { rows: vec![[0.0; SUPPORT]; n] }
    }

    /// Adds `scale · v vᵀ`, where `v` holds `weights` from index `start` on.
    pub(in crate::surface) fn add_outer(&mut self, start: usize, weights: &[f64], scale: f64) {
        for (i, &a) in weights.iter().enumerate() {
            for (j, &b) in weights[..=i].iter().enumerate() {
                self.rows[start + i][i - j] += scale * a * b;
            }
        }
    }

    /// Adds `scale · other`.
    pub(in crate::surface) fn add(&mut self, other: &Self, scale: f64) {
        for (row, other) in self.rows.iter_mut().zip(&other.rows) {
            for (a, b) in row.iter_mut().zip(other) {
                *a += scale * b;
            }
        }
    }

    /// The matrix of order `n` whose last `ends` rows are those of this one, the rows before its first: the same equations on
    /// a shorter axis, if inner rows are alike.
    pub(in crate::surface) fn shortened(&self, n: usize, ends: usize) -> Self {
        let (first, last) = (&self.rows[..n - ends], &self.rows[self.rows.len() - ends..]);
        Self { rows: [first, last].concat() }
    }

    /// Factors the matrix, whose entries lie within `band` of the diagonal (Golub and Van Loan, Matrix
    /// Computations, 4.3.5). A pivot lost to rounding is held at `ε` times its diagonal entry, which
    /// pins what the data leave undetermined.
    pub(in crate::surface) fn factor(self, band: usize) -> Ldl {
        let mut factors = Ldl { lower: self.rows, band };
        factors.factor_from(0);
        factors
    }
}

impl Ldl {
    /// The factors of the matrix of order `n` whose last `ends` rows are those of `matrix`, the rows before its first; these are its
    /// own factors.
    pub(in crate::surface) fn shortened(&self, matrix: &Banded, n: usize, ends: usize) -> Self {
        let (first, last) = (&self.lower[..n - ends], &matrix.rows[matrix.rows.len() - ends..]);
        let mut factors = Self { lower: [first, last].concat(), band: self.band };
        factors.factor_from(n - ends);
        factors
    }

    /// Factors the rows from one on, which still are those of the matrix.
    fn factor_from(&mut self, first: usize) {
        let lower = &mut self.lower;
        for i in first..lower.len() {
            let mut row = lower[i];
            let diagonal = row[0];
            let reach = self.band.min(i);
            // row[d] becomes L_ij D_j, from the far end of the band to the diagonal; j = i − d.
            for d in (1..=reach).rev() {
                for e in d + 1..=reach {
                    row[d] -= row[e] * lower[i - d][e - d];
                }
            }
            let mut pivot = diagonal;
            for d in 1..=reach {
                let scaled = row[d] * lower[i - d][0];
                pivot -= row[d] * scaled;
                row[d] = scaled;
            }
            row[0] = 1.0 / pivot.max(f64::EPSILON * diagonal).max(f64::MIN_POSITIVE);
            lower[i] = row;
        }
    }

    /// Solves `A X = B` in place for `W` right-hand sides side by side.
    pub(in crate::surface) fn solve<const W: usize>(&self, x: &mut [[f64; W]]) {
        let lower = &self.lower;
        match self.band {
            3 => simd::dispatch(Substitute::<3, W> { lower, x }),
            5 => simd::dispatch(Substitute::<5, W> { lower, x }),
            _ => simd::dispatch(Substitute::<{ SUPPORT - 1 }, W> { lower, x }),
        }
    }

    /// The band of the inverse, `result[i][d]` at `(i, i − d)`, from the last row up (Hutchinson and
    /// de Hoog, Smoothing noisy data with spline functions, Numer. Math. 47, 1985):
    /// `Σ_ij = [i = j]/D_i − Σ_{k>i} L_ki Σ_kj` for `j ≥ i`.
    pub(in crate::surface) fn inverse_band(&self) -> Vec<[f64; SUPPORT]> {
        let n = self.lower.len();
        let mut inverse = vec![[0.0; SUPPORT]; n];
        for i in (0..n).rev() {
            let reach = self.band.min(n - 1 - i);
            for d in (0..=reach).rev() {
                let mut sum = if d == 0 { self.lower[i][0] } else { 0.0 };
                for k in 1..=reach {
                    sum -= self.lower[i + k][k] * inverse[i + k.max(d)][k.abs_diff(d)];
                }
                inverse[i + d][d] = sum;
            }
        }
        inverse
    }
}

/// Solves `L D Lᵀ X = B` in place, forward and back.
struct Substitute<'a, const BAND: usize, const W: usize> {
    lower: &'a [[f64; SUPPORT]],
    x: &'a mut [[f64; W]],
}

impl<const BAND: usize, const W: usize> Kernel for Substitute<'_, BAND, W> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { lower, x } = self;
        let n = x.len();
        for i in 1..n {
            let mut sum = x[i];
            for d in 1..=BAND.min(i) {
                subtract(&mut sum, lower[i][d], &x[i - d]);
            }
            x[i] = sum;
        }
        for i in (0..n).rev() {
            let mut sum = x[i];
            for value in &mut sum {
                *value *= lower[i][0];
            }
            for d in 1..=BAND.min(n - 1 - i) {
                subtract(&mut sum, lower[i + d][d], &x[i + d]);
            }
            x[i] = sum;
        }
    }
}

#[inline(always)]
fn subtract<const W: usize>(sum: &mut [f64; W], factor: f64, x: &[f64; W]) {
    for i in 0..W {
        sum[i] -= factor * x[i];
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Second differences plus the identity, twice over: a band of 2 with known products.
    fn example(n: usize) -> Banded {
        let mut a = Banded::zero(n);
        for i in 0..n {
            a.add_outer(i, &[1.0], 1.0);
            if i + 2 < n {
                a.add_outer(i, &[1.0, -2.0, 1.0], 10.0);
            }
        }
        a
    }

    fn times(a: &Banded, x: &[f64]) -> Vec<f64> {
        let n = x.len();
        let entry =
            |i: usize, j: usize| a.rows[i.max(j)].get(i.abs_diff(j)).copied().unwrap_or(0.0);
        (0..n).map(|i| (0..n).map(|j| entry(i, j) * x[j]).sum()).collect()
    }

    #[test]
    fn solves_what_it_multiplied() {
        for n in [1, 2, 3, 4, 9, 40] {
            let a = example(n);
            let x: Vec<f64> = (0..n).map(|i| (i as f64 * 0.7).sin() + 0.1).collect();
            let b = times(&a, &x);
            for band in [3, 5] {
                let mut y: Vec<[f64; 2]> = b.iter().map(|&v| [v, 2.0 * v]).collect();
                a.clone().factor(band).solve(&mut y);
                for (x, y) in x.iter().zip(&y) {
                    assert!((x - y[0]).abs() < 1e-12 && (2.0 * x - y[1]).abs() < 1e-12);
                }
            }
        }
    }

    #[test]
    fn band_of_the_inverse_matches_solves() {
        let n = 12;
        let factor = example(n).factor(3);
        let band = factor.inverse_band();
        for j in 0..n {
            let mut e = vec![[0.0]; n];
            e[j] = [1.0];
            factor.solve(&mut e);
            for i in j..n.min(j + 4) {
                assert!((band[i][i - j] - e[i][0]).abs() < 1e-13);
            }
        }
    }
}
