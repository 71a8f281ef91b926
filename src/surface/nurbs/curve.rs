//! Curves that surfaces are made of.

use std::f64::consts::FRAC_1_SQRT_2;

use glam::{DVec3, DVec4, Vec4Swizzles};

use super::{Knots, check_weights, coincide, homogeneous, size};
use crate::error::{Error, Result};

/// A rational B-spline curve in space: profile, section or trajectory of a [`NurbsSurface`](super::NurbsSurface).
#[derive(Clone, Debug, PartialEq)]
pub struct NurbsCurve {
    pub(super) knots: Knots,
    pub(super) closed: bool,
    /// `(w x, w y, w z, w)`.
    pub(super) net: Vec<DVec4>,
}

impl NurbsCurve {
    /// The curve of `points`, each `(x, y, z, weight)`, in metres. A closed one ends where it began.
    ///
    /// # Errors
    /// [`Error::Argument`] if the number of points is not that of the knots' splines, a number is out of range as in
    /// [`NurbsSurface::new`](super::NurbsSurface::new), or a closed curve does not end where it began.
    pub fn new(knots: Knots, closed: bool, points: &[DVec4]) -> Result<Self> {
        if points.len() != knots.controls() {
            return Err(Error::argument(
                "the number of control points",
                points.len(),
                format!("{}, as the knots say", knots.controls()),
            ));
        }
        let net = homogeneous(points)?;
        check_weights(&net)?;
        let curve = Self { knots, closed, net };
        let [from, to] = curve.knots.domain().map(|u| [curve.homogeneous_at(u)]);
        if closed && !coincide(&from, &to, size(&curve.net)) {
            return Err(Error::argument(
                "the end of a closed curve",
                "not its beginning",
                "the same point",
            ));
        }
        Ok(curve)
    }

    /// The curve of a degree through points, its parameter in proportion to the chords between them (The NURBS Book, algorithm A9.1).
    ///
    /// # Errors
    /// [`Error::Argument`] if there are fewer than `degree + 1` points, two that follow each other coincide, or one is out of range.
    pub fn through(points: &[DVec3], degree: usize) -> Result<Self> {
        let points: Vec<DVec4> = points.iter().map(|p| p.extend(1.0)).collect();
        let net = homogeneous(&points)?;
        let chords = net.windows(2).map(|ends| ends[0].distance(ends[1]));
        let (knots, places) = interpolating(degree, chords)?;
        let net = interpolated(&knots, &places, net);
        Ok(Self { knots, closed: false, net })
    }

    /// A polyline.
    ///
    /// # Errors
    /// As [`through`](Self::through).
    pub fn polyline(points: &[DVec3]) -> Result<Self> {
        Self::through(points, 1)
    }

    /// The ellipse `centre + cos(t) x + sin(t) y`, exactly: nine points of degree 2 (The NURBS Book, section 7.5). A circle if
    /// `x` and `y` are orthogonal and of one length.
    ///
    /// # Errors
    /// [`Error::Argument`] for a coordinate out of range.
    pub fn ellipse(centre: DVec3, x: DVec3, y: DVec3) -> Result<Self> {
        Self::new(ring_knots()?, true, &ring(centre, x, y))
    }

    /// Least and greatest parameter.
    #[must_use]
    pub fn domain(&self) -> [f64; 2] {
        self.knots.domain()
    }

    /// The point at a parameter, which is moved into the domain, m.
    #[must_use]
    pub fn point(&self, u: f64) -> DVec3 {
        let p = self.homogeneous_at(u);
        p.xyz() / p.w
    }

    /// The derivative by the parameter, m per unit of it.
    #[must_use]
    pub fn tangent(&self, u: f64) -> DVec3 {
        let (p, slope) = (self.homogeneous_at(u), self.derivative(u, 1));
        (slope.xyz() - slope.w * p.xyz() / p.w) / p.w
    }

    /// `(w x, w y, w z, w)`.
    fn homogeneous_at(&self, u: f64) -> DVec4 {
        self.derivative(u, 0)
    }

    /// `k`-th derivative of `(w x, w y, w z, w)`.
    fn derivative(&self, u: f64, k: usize) -> DVec4 {
        let basis = self.knots.basis(u);
        (0..=self.knots.degree()).map(|i| basis.of[i][k] * self.net[basis.first + i]).sum()
    }

    /// The same curve with one more knot at `u`.
    ///
    /// # Errors
    /// As [`NurbsSurface::with_knot`](super::NurbsSurface::with_knot).
    pub fn with_knot(&self, u: f64) -> Result<Self> {
        let (knots, shares) = self.knots.inserted(u)?;
        Ok(Self { knots, net: inserted(&self.net, &shares), ..*self })
    }
}

/// Control points with one more: `α_i P_i + (1 − α_i) P_{i−1}`.
pub(super) fn inserted(line: &[DVec4], shares: &[f64]) -> Vec<DVec4> {
    let last = line.len() - 1;
    let blend =
        |(i, share): (usize, &f64)| line[i.saturating_sub(1)].lerp(line[i.min(last)], *share);
    shares.iter().enumerate().map(blend).collect()
}

/// Knots of the nine points of [`ring`].
pub(super) fn ring_knots() -> Result<Knots> {
    Knots::clamped_at(2, [0.25, 0.25, 0.5, 0.5, 0.75, 0.75].into_iter())
}

/// The control points `(x, y, z, weight)` of an ellipse.
pub(super) fn ring(centre: DVec3, x: DVec3, y: DVec3) -> [DVec4; 9] {
    let corners = [(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1), (1, 0)];
    corners.map(|(i, j)| {
        let weight = if i * j == 0 { 1.0 } else { FRAC_1_SQRT_2 };
        (centre + f64::from(i) * x + f64::from(j) * y).extend(weight)
    })
}

/// Clamped knots and places for interpolation at points these chords apart: places in proportion to the chords, knots
/// their means over a degree (The NURBS Book, equations 9.5 and 9.8), so that every spline has a place.
///
/// # Errors
/// A chord that is not above 0, a degree out of range, too few points.
pub(super) fn interpolating(
    degree: usize,
    chords: impl Iterator<Item = f64>,
) -> Result<(Knots, Vec<f64>)> {
    let mut places = vec![0.0];
    for chord in chords {
        if !(chord > 0.0 && chord.is_finite()) {
            return Err(Error::argument(
                format!("the distance of points {} and {}", places.len() - 1, places.len()),
                chord,
                "above 0 and finite, for a spline goes through points apart",
            ));
        }
        places.push(places[places.len() - 1] + chord);
    }
    let last = places.len() - 1;
    if last < degree || last >= Knots::MAX_CONTROLS {
        return Err(Error::argument(
            "the number of points of a spline",
            places.len(),
            format!("above the degree {degree} and at most {}", Knots::MAX_CONTROLS),
        ));
    }
    let total = places[last];
    places.iter_mut().for_each(|place| *place /= total);
    let mean = |i: usize| places[i..i + degree].iter().sum::<f64>() / degree as f64;
    let knots = Knots::clamped_at(degree, (1..=last - degree).map(mean))?;
    Ok((knots, places))
}

/// The control points whose spline has these values at the places: `Σ_i N_i(u_k) P_i = Q_k`.
///
/// The matrix is banded and totally positive, so elimination needs no pivots (de Boor, A Practical Guide to Splines, chapter XIII).
pub(super) fn interpolated(knots: &Knots, places: &[f64], mut values: Vec<DVec4>) -> Vec<DVec4> {
    let p = knots.degree();
    // Row k holds the columns k − p … k + p.
    let mut band = vec![[0.0; 2 * Knots::MAX_DEGREE + 1]; places.len()];
    for (k, &u) in places.iter().enumerate() {
        let basis = knots.basis(u);
        for i in 0..=p {
            if let Some(entry) =
                (basis.first + i + p).checked_sub(k).and_then(|at| band[k].get_mut(at))
            {
                *entry = basis.of[i][0];
            }
        }
    }
    for k in 0..places.len() {
        for row in k + 1..places.len().min(k + p + 1) {
            let share = band[row][k + p - row] / band[k][p];
            for at in 0..=p {
                band[row][k + p - row + at] -= share * band[k][p + at];
            }
            values[row] = values[row] - share * values[k];
        }
    }
    for k in (0..places.len()).rev() {
        for at in 1..=p.min(places.len() - 1 - k) {
            values[k] = values[k] - band[k][p + at] * values[k + at];
        }
        values[k] /= band[k][p];
    }
    values
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ellipses_are_exact_and_closed() {
        let ring = NurbsCurve::ellipse(DVec3::ONE, 2.0 * DVec3::X, 2.0 * DVec3::Y).unwrap();
        for k in 0..=50 {
            let u = f64::from(k) / 50.0;
            assert!((ring.point(u).distance(DVec3::ONE) - 2.0).abs() < 1e-14);
            assert!(ring.tangent(u).dot(ring.point(u) - DVec3::ONE).abs() < 1e-13);
        }
        assert!(ring.point(0.25).distance(DVec3::new(1.0, 3.0, 1.0)) < 1e-14);
    }

    #[test]
    fn splines_go_through_their_points_and_reproduce_polynomials() {
        for degree in 1..=6 {
            let points: Vec<DVec3> = (0..12)
                .map(|i| DVec3::new(f64::from(i), f64::from(i * i % 7), (0.7 * f64::from(i)).sin()))
                .collect();
            let curve = NurbsCurve::through(&points, degree).unwrap();
            let chords = points.windows(2).map(|p| p[0].distance(p[1]));
            let (_, places) = interpolating(degree, chords).unwrap();
            for (u, point) in places.iter().zip(&points) {
                assert!(curve.point(*u).distance(*point) < 1e-11, "degree {degree}");
            }
        }
        // On a line the parameter is the length, whatever the degree.
        let line = |t: f64| DVec3::new(1.0, 2.0, -2.0) * t;
        let points = [0.0, 0.5, 0.6, 2.0, 3.5, 4.0].map(line);
        let curve = NurbsCurve::through(&points, 4).unwrap();
        assert!(curve.point(0.3).distance(line(1.2)) < 1e-13);
        assert!(curve.tangent(0.3).distance(line(4.0)) < 1e-12);
    }

    #[test]
    fn a_knot_changes_no_point() {
        let mut curve = NurbsCurve::ellipse(DVec3::ZERO, DVec3::X, DVec3::Y + DVec3::Z).unwrap();
        let before = curve.clone();
        for u in [0.1, 0.1, 0.6, 0.30001] {
            curve = curve.with_knot(u).unwrap();
        }
        assert!(curve.with_knot(0.1).is_err());
        for k in 0..=40 {
            let u = f64::from(k) / 40.0;
            assert!(curve.point(u).distance(before.point(u)) < 1e-15);
            assert!(curve.tangent(u).distance(before.tangent(u)) < 1e-13);
        }
    }

    #[test]
    fn wrong_curves_are_refused() {
        assert!(NurbsCurve::through(&[DVec3::ZERO], 1).is_err());
        assert!(NurbsCurve::through(&[DVec3::ZERO; 4], 3).is_err());
        assert!(NurbsCurve::through(&[DVec3::X, DVec3::NAN], 1).is_err());
        assert!(NurbsCurve::through(&[DVec3::X, DVec3::Y], 0).is_err());
        let open = [DVec4::W, DVec4::ONE];
        assert!(NurbsCurve::new(Knots::clamped(1, 2).unwrap(), true, &open).is_err());
        assert!(NurbsCurve::new(Knots::clamped(1, 2).unwrap(), false, &[DVec4::ZERO; 2]).is_err());
    }
}
