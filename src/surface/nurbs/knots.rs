//! One parameter of a spline: its degree and its knots.

use crate::error::{Error, Result};

/// Degree and knots `u_0 ≤ u_1 ≤ …` of B-splines `N_i`, one for each control point; `N_i` is 0 outside `u_i … u_{i+p+1}`.
///
/// Invariants: the degree `p` is 1 to [`MAX_DEGREE`](Self::MAX_DEGREE); there are `p + 1` control points or more; the knots are
/// finite and ascend; inside the [domain](Self::domain) none comes more than `p` times, anywhere none more than `p + 1`
/// times, and different ones differ by more than 1e-9 of the domain.
#[derive(Clone, Debug, PartialEq)]
pub struct Knots {
    degree: usize,
    knots: Vec<f64>,
}

/// The splines that are not 0 at a parameter.
#[derive(Clone, Copy, Debug)]
pub(super) struct Basis {
    /// Index of the first.
    pub(super) first: usize,
    /// `of[i]`: spline `first + i` and its first and second derivative.
    pub(super) of: [[f64; 3]; Knots::MAX_DEGREE + 1],
}

impl Knots {
    /// The highest degree.
    pub const MAX_DEGREE: usize = 15;
    /// The most control points, of a surface too.
    pub const MAX_CONTROLS: usize = 1_000_000;

    /// The knots of splines of a degree.
    ///
    /// # Errors
    /// [`Error::Argument`] that says which invariant does not hold.
    pub fn new(degree: usize, knots: Vec<f64>) -> Result<Self> {
        if !(1..=Self::MAX_DEGREE).contains(&degree) {
            let most = Self::MAX_DEGREE;
            return Err(Error::argument("the degree of a spline", degree, format!("1 to {most}")));
        }
        if knots.len() < 2 * (degree + 1) {
            return Err(Error::argument(
                "the number of knots",
                knots.len(),
                format!("{} or more for degree {degree}", 2 * (degree + 1)),
            ));
        }
        if let Some(i) = knots.iter().position(|u| !u.is_finite()) {
            return Err(Error::argument(format!("knot {i}"), knots[i], "finite"));
        }
        if let Some(i) = knots.windows(2).position(|pair| pair[0] > pair[1]) {
            return Err(Error::argument(
                format!("knot {}", i + 1),
                knots[i + 1],
                format!("{} or more, as knots ascend", knots[i]),
            ));
        }
        let knots = Self { degree, knots };
        let [from, to] = knots.domain();
        let length = to - from;
        if !(length > 0.0 && length.is_finite()) {
            return Err(Error::argument(
                format!("the length of the domain from knot {from} to {to}"),
                length,
                "above 0 and finite",
            ));
        }
        if let Some(pair) = knots.knots.windows(2).find(|pair| {
            let step = pair[1] - pair[0];
            step > 0.0 && step <= NARROWEST * length
        }) {
            return Err(Error::argument(
                format!("the distance of the knots {} and {}", pair[0], pair[1]),
                pair[1] - pair[0],
                format!("0, or above {NARROWEST:e} of the domain"),
            )
            .advise("make them equal or move them apart"));
        }
        let most = |u: f64| if from < u && u < to { degree } else { degree + 1 };
        if let Some(&u) = knots.knots.iter().find(|&&u| knots.multiplicity(u) > most(u)) {
            return Err(Error::argument(
                format!("the multiplicity of the knot {u}"),
                knots.multiplicity(u),
                format!("at most {} at degree {degree}", most(u)),
            ));
        }
        Ok(knots)
    }

    /// Equally spaced knots over 0 to 1 whose spline begins at the first of `controls` control points and ends at the last.
    ///
    /// # Errors
    /// [`Error::Argument`] for a degree out of range, fewer than `degree + 1` control points or more than [`MAX_CONTROLS`](Self::MAX_CONTROLS).
    pub fn clamped(degree: usize, controls: usize) -> Result<Self> {
        if controls <= degree || controls > Self::MAX_CONTROLS {
            return Err(Error::argument(
                "the number of control points",
                controls,
                format!("above the degree {degree} and at most {}", Self::MAX_CONTROLS),
            ));
        }
        let pieces = controls - degree;
        let inner = (1..pieces).map(|i| i as f64 / pieces as f64);
        Self::clamped_at(degree, inner)
    }

    /// Clamped knots over 0 to 1, with these between the ends.
    pub(super) fn clamped_at(degree: usize, inner: impl Iterator<Item = f64>) -> Result<Self> {
        let end = |u: f64| std::iter::repeat_n(u, degree.min(Self::MAX_DEGREE) + 1);
        Self::new(degree, end(0.0).chain(inner).chain(end(1.0)).collect())
    }

    /// The degree `p`.
    #[must_use]
    pub fn degree(&self) -> usize {
        self.degree
    }

    /// The knots.
    #[must_use]
    pub fn as_slice(&self) -> &[f64] {
        &self.knots
    }

    /// How many control points there are.
    #[must_use]
    pub fn controls(&self) -> usize {
        self.knots.len() - self.degree - 1
    }

    /// Least and greatest parameter.
    #[must_use]
    pub fn domain(&self) -> [f64; 2] {
        [self.knots[self.degree], self.knots[self.controls()]]
    }

    /// How often a knot comes.
    fn multiplicity(&self, u: f64) -> usize {
        self.knots.partition_point(|&knot| knot <= u) - self.knots.partition_point(|&knot| knot < u)
    }

    /// The intervals of the domain between different knots.
    pub(super) fn spans(&self) -> impl Iterator<Item = [f64; 2]> + '_ {
        let spans = self.knots[self.degree..=self.controls()].windows(2);
        spans.filter(|ends| ends[0] < ends[1]).map(|ends| [ends[0], ends[1]])
    }

    /// The index `k` with `u_k ≤ u < u_{k+1}` in the domain; at its end, that of the last interval.
    fn span(&self, u: f64) -> usize {
        let inner = &self.knots[self.degree + 1..self.controls()];
        let [_, to] = self.domain();
        self.degree + inner.partition_point(|&knot| knot <= u && knot < to)
    }

    /// The splines at a parameter, which is moved into the domain, with two derivatives; those from the right at a knot, from
    /// the left at the end of the domain.
    ///
    /// The recursion of Cox and de Boor (Piegl and Tiller, The NURBS Book, equations 2.5 and 2.7) from degree `j − 1` to `j`,
    /// for all derivatives at once: with `q_i = N_{i,j−1}/(u_{i+j} − u_i)`
    ///
    /// ```text
    ///   N_{i,j} = (u − u_i) q_i + (u_{i+j+1} − u) q_{i+1} ,     N⁽ᵏ⁾_{i,j} = j (q⁽ᵏ⁻¹⁾_i − q⁽ᵏ⁻¹⁾_{i+1}) .
    /// ```
    pub(super) fn basis(&self, u: f64) -> Basis {
        let [from, to] = self.domain();
        let u = u.clamp(from, to);
        let span = self.span(u);
        let mut of = [[0.0; 3]; Self::MAX_DEGREE + 1];
        of[0][0] = 1.0;
        for j in 1..=self.degree {
            // What the spline before leaves for this one.
            let mut carried = [0.0; 3];
            for (i, n) in of.iter_mut().enumerate().take(j) {
                let (low, high) = (self.knots[span + 1 + i - j], self.knots[span + 1 + i]);
                let q = n.map(|n| n / (high - low));
                let slopes = [q[0], q[1]].map(|q| j as f64 * q);
                *n = [
                    carried[0] + (high - u) * q[0],
                    carried[1] - slopes[0],
                    carried[2] - slopes[1],
                ];
                carried = [(u - low) * q[0], slopes[0], slopes[1]];
            }
            of[j] = carried;
        }
        Basis { first: span - self.degree, of }
    }

    /// Knots with one more at `u`, and the shares `α_i` that make the new control points `α_i P_i + (1 − α_i) P_{i−1}` (Boehm;
    /// The NURBS Book, equation 5.15).
    ///
    /// # Errors
    /// A `u` that is not inside the domain or is a knot of full multiplicity already.
    pub(super) fn inserted(&self, u: f64) -> Result<(Self, Vec<f64>)> {
        let [from, to] = self.domain();
        if !(from < u && u < to) {
            return Err(Error::argument("a new knot", u, format!("between {from} and {to}")));
        }
        let span = self.span(u);
        let mut knots = self.knots.clone();
        knots.insert(span + 1, u);
        let shares = (0..=self.controls()).map(|i| self.insertion_share(i, u, span)).collect();
        Ok((Self::new(self.degree, knots)?, shares))
    }

    /// `α_i` of a knot at `u` in a span, see [`inserted`](Self::inserted).
    fn insertion_share(&self, i: usize, u: f64, span: usize) -> f64 {
        let end = i + self.degree;
        if end <= span {
            1.0
        } else if i > span {
            0.0
        } else {
            (u - self.knots[i]) / (self.knots[end] - self.knots[i])
        }
    }

    /// Knots of the parameter `t = c s/(1 + (c − 1) s)`, where `s` and `t` run from 0 to 1 over the domain, and the factors
    /// that the control points take.
    ///
    /// With `s = t/M(t)`, `M(t) = c + (1 − c) t`, a piece `P(s)` of degree `p` becomes `M(t)^p P(t/M(t))`, and by their blossoms
    /// control point `i` is multiplied by `∏ M(t_{i+j})`, `j = 1 … p`.
    ///
    /// # Errors
    /// A ratio that is not above 0, or so far from 1 that a knot outside the domain goes to infinity.
    pub(super) fn moebius(&self, ratio: f64) -> Result<(Self, Vec<f64>)> {
        let [from, to] = self.domain();
        let share = |u: f64| (u - from) / (to - from);
        let pole = |&u: &f64| 1.0 + (ratio - 1.0) * share(u);
        if !(ratio.is_finite() && ratio > 0.0) || self.knots.iter().any(|u| pole(u) <= 0.0) {
            return Err(Error::argument(
                "the ratio of a Möbius map",
                ratio,
                "above 0, and on knots beyond the domain not far from 1",
            ));
        }
        let image = |u: &f64| ratio * share(*u) / pole(u);
        // Rounding must not move the ends.
        let images: Vec<f64> = self.knots.iter().map(image).collect();
        let knots = images
            .iter()
            .zip(&self.knots)
            .map(|(t, &u)| if u == from || u == to { u } else { from + (to - from) * t });
        let factor = |i: usize| {
            images[i + 1..=i + self.degree].iter().map(|t| ratio + (1.0 - ratio) * t).product()
        };
        let factors = (0..self.controls()).map(factor).collect();
        Ok((Self::new(self.degree, knots.collect())?, factors))
    }
}

/// Different knots are farther apart than this share of the domain: derivatives over shorter intervals are noise.
const NARROWEST: f64 = 1e-9;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn splines_sum_to_one_and_derivatives_are_slopes() {
        for degree in 1..=7 {
            let mut u: Vec<f64> = (0..2 * degree + 9).map(|i| i as f64).collect();
            if degree > 1 {
                u[degree + 2] = u[degree + 1];
            }
            let knots = Knots::new(degree, u).unwrap();
            let [from, to] = knots.domain();
            for k in 0..40 {
                let u = from + (to - from) * (f64::from(k) + 0.5) / 40.0;
                let step = 1e-5;
                let dense = |u: f64| {
                    let basis = knots.basis(u);
                    let mut all = vec![[0.0; 3]; knots.controls()];
                    for i in 0..=degree {
                        all[basis.first + i] = basis.of[i];
                    }
                    all
                };
                let (before, here, after) = (dense(u - step), dense(u), dense(u + step));
                let sums = [0, 1, 2].map(|k| here.iter().map(|n| n[k]).sum::<f64>());
                assert!((sums[0] - 1.0).abs() < 1e-13 && sums[1].abs() < 1e-12);
                for i in 0..knots.controls() {
                    for k in 0..2 {
                        let slope = (after[i][k] - before[i][k]) / (2.0 * step);
                        assert!((slope - here[i][k + 1]).abs() < 1e-6, "degree {degree}, {u}");
                    }
                }
            }
        }
    }

    #[test]
    fn wrong_knots_are_refused() {
        for (degree, knots, said) in [
            (0, vec![0.0, 1.0], "degree of a spline is 0"),
            (99, vec![0.0; 300], "is 99"),
            (2, vec![0.0, 0.0, 0.0, 1.0, 1.0], "6 or more"),
            (1, vec![0.0, 0.0, f64::NAN, 1.0, 1.0], "finite"),
            (1, vec![0.0, 0.0, 0.7, 0.5, 1.0, 1.0], "ascend"),
            (1, vec![0.0, 0.0, 0.5, 0.5, 1.0, 1.0], "knot 0.5 is 2"),
            (1, vec![0.0, 0.0, 0.0, 0.5, 1.0, 1.0], "knot 0 is 3"),
            (1, vec![1.0; 6], "length of the domain"),
            (1, vec![0.0, 0.0, 1e-12, 1.0, 1.0], "make them equal"),
        ] {
            let error = Knots::new(degree, knots).unwrap_err().to_string();
            assert!(error.contains(said), "{error}");
        }
        assert!(Knots::clamped(3, 3).is_err());
        assert!(Knots::clamped(usize::MAX, 3).is_err());
        let knots = Knots::clamped(2, 5).unwrap();
        assert_eq!(knots.controls(), 5);
        assert!(knots.inserted(0.0).is_err() && knots.inserted(f64::NAN).is_err());
        assert!(knots.moebius(0.0).is_err() && knots.moebius(f64::NAN).is_err());
    }
}
