//! Uniform B-splines along one axis: which coefficients bear on a point, and with what weights.

use std::ops::Range;

/// Most coefficients that bear on one point: degree 5 plus 1.
pub(in crate::surface) const SUPPORT: usize = 6;

/// Derivatives that are evaluated: value, first, second, third.
pub(in crate::surface) const ORDERS: usize = 4;

/// Splines of odd degree `p` with equally spaced knots over the nodes `0 ..= nodes − 1`, one
/// coefficient `c_0 … c_m` for each of the `m + 1` knots.
///
/// A point between knots `k` and `k + 1` needs `c_{k−g} … c_{k+1+g}`, `g = (p − 1)/2`. Beyond the end
/// knots the coefficients continue as a polynomial of degree `q = min(p, m)`:
///
/// ```text
///   Σ_i (−1)^i C(q+1, i) c_{j+i} = 0      for every window that holds a coefficient outside 0 … m
/// ```
///
/// A `(p+1)`-th difference of coefficients is the jump of the `p`-th derivative at a knot (de Boor,
/// A Practical Guide to Splines, ch. X), so this is the *not-a-knot* condition: polynomials of degree `p`
/// are reproduced and the order of approximation is kept up to the border. With fewer than `p + 1` knots
/// it leaves the polynomials of degree `m`; one knot, a constant. The outer coefficients are never
/// stored: [`Basis::at`] folds their weights onto the inner ones.
#[derive(Clone, Debug)]
pub(in crate::surface) struct Basis {
    degree: usize,
    intervals: usize,
    /// Knot intervals per node.
    density: f64,
    /// The knot of its axis where it begins.
    first: usize,
}

/// The coefficients that bear on one point.
#[derive(Clone, Copy, Debug)]
pub(in crate::surface) struct Local {
    /// Index of the first.
    pub(in crate::surface) start: usize,
    /// `weights[r][i]`: share of coefficient `start + i` in the `r`-th derivative, per node to the `r`.
    pub(in crate::surface) weights: [[f64; SUPPORT]; ORDERS],
}

impl Basis {
    /// Splines of degree 3 or 5 over `nodes` nodes with `intervals < nodes` knot intervals.
    pub(in crate::surface) fn new(degree: usize, nodes: usize, intervals: usize) -> Self {
        debug_assert!(intervals < nodes && degree % 2 == 1 && degree < SUPPORT);
        let density = if nodes > 1 { intervals as f64 / (nodes - 1) as f64 } else { 1.0 };
        Self { degree, intervals, density, first: 0 }
    }

    /// The splines over a run of the knots.
    pub(in crate::surface) fn section(&self, run: &Range<usize>) -> Self {
        Self { intervals: run.len() - 1, first: self.first + run.start, ..*self }
    }

    /// Degree of the splines.
    pub(in crate::surface) fn degree(&self) -> usize {
        self.degree
    }

    /// Number of coefficients.
    pub(in crate::surface) fn len(&self) -> usize {
        self.intervals + 1
    }

    /// Number of knot intervals.
    pub(in crate::surface) fn intervals(&self) -> usize {
        self.intervals
    }

    /// The place `u` into an interval between knots, counted in nodes.
    pub(in crate::surface) fn node(&self, interval: usize, u: f64) -> f64 {
        ((self.first + interval) as f64 + u) / self.density
    }

    /// Knot intervals per node, at most 1.
    pub(in crate::surface) fn density(&self) -> f64 {
        self.density
    }

    /// Coefficients that bear on one point, at most [`SUPPORT`].
    pub(in crate::surface) fn support(&self) -> usize {
        self.degree.min(self.intervals) + 1
    }

    /// The coefficients and weights at `t`, counted in nodes.
    pub(in crate::surface) fn at(&self, t: f64) -> Local {
        let x = t * self.density - self.first as f64;
        let knot = (x.max(0.0) as usize).min(self.intervals.saturating_sub(1));
        let reach = (self.degree - 1) / 2;
        let first = knot as isize - reach as isize;
        let start = first.clamp(0, (self.len() - self.support()) as isize);
        let mut weights = [[0.0; SUPPORT]; ORDERS];
        let mut scale = 1.0;
        for (order, folded) in weights.iter_mut().enumerate() {
            let plain = cardinal(self.degree, order, x - knot as f64);
            *folded = self.fold(&plain, first - start).map(|w| w * scale);
            scale *= self.density;
        }
        Local { start: start as usize, weights }
    }

    /// Moves the weights of coefficients outside the window `0 .. support` into it. `plain[0]` belongs
    /// to index `first` relative to the window.
    fn fold(&self, plain: &[f64; SUPPORT], first: isize) -> [f64; SUPPORT] {
        // Away from the ends, where almost all points are, nothing is outside.
        if first == 0 && self.support() > self.degree {
            return *plain;
        }
        // Relative indices −5 … 10 suffice: a point's own coefficients overlap the window.
        const MARGIN: usize = SUPPORT - 1;
        let mut line = [0.0; SUPPORT + 2 * MARGIN];
        let offset = (MARGIN as isize + first) as usize;
        line[offset..=offset + self.degree].copy_from_slice(&plain[..=self.degree]);

        let support = self.support();
        let extrapolation = extrapolation(support);
        for outer in 0..MARGIN {
            for i in 1..=support {
                line[outer + i] += extrapolation[i - 1] * line[outer];
            }
        }
        for outer in (MARGIN + support..line.len()).rev() {
            for i in 1..=support {
                line[outer - i] += extrapolation[i - 1] * line[outer];
            }
        }
        let mut folded = [0.0; SUPPORT];
        folded[..support].copy_from_slice(&line[MARGIN..MARGIN + support]);
        folded
    }
}

/// `e_i` of `c_j = Σ_{i=1}^{n} e_i c_{j+i}` for coefficients on a polynomial of degree `n − 1`:
/// `e_i = (−1)^{i+1} C(n, i)`.
fn extrapolation(n: usize) -> [f64; SUPPORT] {
    let mut e = [0.0; SUPPORT];
    let mut binomial = -1.0;
    for i in 1..=n {
        binomial *= -((n + 1 - i) as f64) / i as f64;
        e[i - 1] = binomial;
    }
    e
}

/// The `order`-th derivative of the `degree + 1` B-splines with unit knots that do not vanish at `u`,
/// `0 ≤ u ≤ 1` into their common interval, by the recursions (de Boor, ch. X, eq. 4b and 15)
///
/// ```text
///   N_j^d = ((u + d − j) N_{j−1}^{d−1} + (j + 1 − u) N_j^{d−1}) / d        (N_j^d)' = N_{j−1}^{d−1} − N_j^{d−1}
/// ```
fn cardinal(degree: usize, order: usize, u: f64) -> [f64; SUPPORT] {
    if degree == 3 {
        let [a, b, c, d] = cubic(order, u);
        return [a, b, c, d, 0.0, 0.0];
    }
    let mut b = [0.0; SUPPORT];
    b[0] = 1.0;
    for d in 1..=degree {
        for j in (0..=d).rev() {
            let left = if j > 0 { b[j - 1] } else { 0.0 };
            b[j] = if d + order <= degree {
                ((u + (d - j) as f64) * left + ((j + 1) as f64 - u) * b[j]) / d as f64
            } else {
                left - b[j]
            };
        }
    }
    b
}

/// The same for degree 3, written out: routes ask for it at millions of points.
fn cubic(order: usize, u: f64) -> [f64; 4] {
    let v = 1.0 - u;
    match order {
        0 => [
            v * v * v / 6.0,
            (4.0 - 3.0 * u * u * (1.0 + v)) / 6.0,
            (4.0 - 3.0 * v * v * (1.0 + u)) / 6.0,
            u * u * u / 6.0,
        ],
        1 => [-0.5 * v * v, u * (1.5 * u - 2.0), v * (2.0 - 1.5 * v), 0.5 * u * u],
        2 => [v, 3.0 * u - 2.0, 3.0 * v - 2.0, u],
        _ => [-1.0, 3.0, -3.0, 1.0],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_at_a_knot_are_the_tabulated_ones() {
        let cubic = Basis::new(3, 11, 10).at(5.0);
        assert_eq!(cubic.start, 4);
        let expected = [
            [1.0 / 6.0, 4.0 / 6.0, 1.0 / 6.0, 0.0],
            [-0.5, 0.0, 0.5, 0.0],
            [1.0, -2.0, 1.0, 0.0],
            [-1.0, 3.0, -3.0, 1.0],
        ];
        for (got, want) in cubic.weights.iter().zip(expected) {
            assert!(got.iter().zip(want).all(|(a, b)| (a - b).abs() < 1e-15), "{got:?}");
        }
        let quintic = Basis::new(5, 11, 10).at(5.0).weights[0];
        for (got, want) in quintic.iter().zip([1.0, 26.0, 66.0, 26.0, 1.0, 0.0]) {
            assert!((got * 120.0 - want).abs() < 1e-13);
        }
    }

    #[test]
    fn weights_add_up_to_one_and_derivatives_to_zero() {
        for degree in [3, 5] {
            for (nodes, intervals) in [(1, 0), (2, 1), (3, 2), (5, 4), (6, 5), (40, 39), (40, 17)] {
                let basis = Basis::new(degree, nodes, intervals);
                for i in 0..=50 {
                    let local = basis.at(i as f64 / 50.0 * (nodes - 1) as f64);
                    assert!(local.start + basis.support() <= basis.len());
                    for (order, weights) in local.weights.iter().enumerate() {
                        let sum: f64 = weights.iter().sum();
                        let expected = if order == 0 { 1.0 } else { 0.0 };
                        assert!((sum - expected).abs() < 1e-11, "{degree} {nodes} {intervals}");
                    }
                }
            }
        }
    }

    #[test]
    fn weights_are_continuous_across_knots_up_to_the_degree() {
        let basis = Basis::new(3, 12, 11);
        // At knots 1 and 10 the third derivative is continuous too: they are no knots.
        for (knot, orders) in [(1.0, 4), (4.0, 3), (10.0, 4)] {
            let value = |t: f64, order: usize| -> f64 {
                let local = basis.at(t);
                (0..basis.support())
                    .map(|i| local.weights[order][i] * ((local.start + i) as f64 * 1.7).sin())
                    .sum()
            };
            for order in 0..orders {
                let jump = value(knot - 1e-9, order) - value(knot + 1e-9, order);
                assert!(jump.abs() < 1e-6, "knot {knot}, order {order}: {jump}");
            }
        }
    }
}
