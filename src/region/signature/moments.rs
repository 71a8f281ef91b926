//! Moments of the differences over a region, and the eigenvalues of their covariance.

use super::labelled_surface::Sum;

/// Weighted sums of vectors and of their products.
#[derive(Clone, Copy, Default)]
pub(super) struct Moments {
    weight: f64,
    first: [f64; 4],
    second: [[f64; 4]; 4],
}

impl Moments {
    /// Those of one vector; none if it is not finite or has no weight.
    pub(super) fn of(v: [f64; 4], weight: f64) -> Self {
        Self::weighted(weight, v, v.map(|a| v.map(|b| a * b)))
    }

    /// The mean of those of `(a, b, c, d)`, `(b, a, c, d)`, `(a, b, d, c)` and `(b, a, d, c)`: which way along a tangent is plus is
    /// arbitrary.
    #[inline(always)]
    pub(super) fn of_pairs([a, b]: [f64; 2], [c, d]: [f64; 2], weight: f64) -> Self {
        let (x, y) = (0.5 * (a + b), 0.5 * (c + d));
        let (xx, yy) = (0.5 * (a * a + b * b), 0.5 * (c * c + d * d));
        let (ab, cd, xy) = (a * b, c * d, x * y);
        let second = [[xx, ab, xy, xy], [ab, xx, xy, xy], [xy, xy, yy, cd], [xy, xy, cd, yy]];
        Self::weighted(weight, [x, x, y, y], second)
    }

    #[inline(always)]
    fn weighted(weight: f64, first: [f64; 4], second: [[f64; 4]; 4]) -> Self {
        if !(weight > 0.0 && first.iter().all(|v| v.is_finite())) {
            return Self::default();
        }
        let by_weight = |v: [f64; 4]| v.map(|v| weight * v);
        Self { weight, first: by_weight(first), second: second.map(by_weight) }
    }

    /// All 0 if nothing was added.
    pub(super) fn covariance(&self) -> [[f64; 4]; 4] {
        let weight = if self.weight > 0.0 { self.weight } else { 1.0 };
        let mean = self.first.map(|sum| sum / weight);
        std::array::from_fn(|i| {
            std::array::from_fn(|j| self.second[i][j] / weight - mean[i] * mean[j])
        })
    }
}

impl Sum for Moments {
    fn add(&mut self, other: &Self) {
        self.weight += other.weight;
        for i in 0..4 {
            self.first[i] += other.first[i];
            for j in 0..4 {
                self.second[i][j] += other.second[i][j];
            }
        }
    }
}

/// Eigenvalues of a positive semidefinite matrix, largest first, by Jacobi's rotations; what rounding made negative is 0.
pub(super) fn eigenvalues(mut a: [[f64; 4]; 4]) -> [f64; 4] {
    /// They converge quadratically; six are enough for 4×4.
    const SWEEPS: usize = 8;
    for _ in 0..SWEEPS {
        for p in 0..4 {
            for q in p + 1..4 {
                if a[p][q] != 0.0 {
                    rotate(&mut a, p, q);
                }
            }
        }
    }
    let mut values: [f64; 4] = std::array::from_fn(|i| a[i][i].max(0.0));
    values.sort_by(|a, b| b.total_cmp(a));
    values
}

/// Turns the plane of axes `p` and `q` so that `a[p][q]` becomes 0 (Golub and Van Loan, section 8.5).
fn rotate(a: &mut [[f64; 4]; 4], p: usize, q: usize) {
    let tau = (a[q][q] - a[p][p]) / (2.0 * a[p][q]);
    let t = 1f64.copysign(tau) / (tau.abs() + tau.hypot(1.0));
    let c = t.hypot(1.0).recip();
    let s = t * c;
    for row in a.iter_mut() {
        (row[p], row[q]) = (c * row[p] - s * row[q], s * row[p] + c * row[q]);
    }
    let (x, y) = (a[p], a[q]);
    a[p] = std::array::from_fn(|k| c * x[k] - s * y[k]);
    a[q] = std::array::from_fn(|k| s * x[k] + c * y[k]);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn eigenvalues_are_those_of_a_known_matrix() {
        // Householder reflection of a diagonal matrix: I − 2vvᵀ, v = (1, 1, 1, 1)/2.
        let diagonal = [3.0, 0.5, 7.0, 0.0];
        let h = |i: usize, j: usize| if i == j { 0.5 } else { -0.5 };
        let a = std::array::from_fn(|i| {
            std::array::from_fn(|j| (0..4).map(|k| h(i, k) * diagonal[k] * h(k, j)).sum())
        });
        for (found, exact) in eigenvalues(a).into_iter().zip([7.0, 3.0, 0.5, 0.0]) {
            assert!((found - exact).abs() < 1e-13);
        }
    }
}
