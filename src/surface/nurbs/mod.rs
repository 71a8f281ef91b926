//! NURBS: rational tensor-product splines in space.
//!
//! [`NurbsSurface`] is the map and its exact derivatives, `knots` the splines of one parameter, `curve` profiles, sections and
//! trajectories, `shapes` surfaces made of them, `file` the JSON form, [`NurbsGrid`] a surface with nodes.
//!
//! No crate is used for them: the evaluation is a few lines, and most of what is here are closed directions, poles, Möbius maps and
//! the checks of input. truck-geometry has none of these and evaluates each derivative by itself; curvo, the most complete, accepts
//! control points and knots that do not fit together, allocates at every point, and depends on an optimiser and a mesh kernel.

mod curve;
mod file;
mod grid;
mod knots;
mod shapes;

use glam::{DVec2, DVec3, DVec4, Vec4Swizzles};

pub use self::curve::NurbsCurve;
pub use self::grid::NurbsGrid;
use self::knots::Basis;
pub use self::knots::Knots;
use super::SurfaceJet;
use crate::error::{Error, Result};

/// A rational tensor-product B-spline surface (Piegl and Tiller, The NURBS Book, chapter 4):
///
/// ```text
///   S(u) = Σ_ij N_i(u1) N_j(u2) w_ij P_ij / Σ_ij N_i(u1) N_j(u2) w_ij ,     control points P_ij, weights w_ij > 0.
/// ```
///
/// Where a direction is *closed*, the surface ends where it began, and its parameter is periodic: one beyond the domain stands for
/// the one in it that differs by whole periods. Any knots may be used for that, clamped ones too; where the derivatives do not match across
/// the seam, the surface has a crease there or at least its parameters have.
#[derive(Clone, Debug, PartialEq)]
pub struct NurbsSurface {
    knots: [Knots; 2],
    closed: [bool; 2],
    /// `(w x, w y, w z, w)`, the first parameter running fastest.
    net: Vec<DVec4>,
}

/// Lengths below this share of the surface's size, and sines of angles below it, are 0 but for rounding.
const SMALL: f64 = 1e-9;
/// The largest coordinate, m: beyond, squares of areas overflow. A thousand times as far as the sun.
const FARTHEST: f64 = 1e14;
/// Weights lie between this and its inverse.
const LIGHTEST: f64 = 1e-9;

impl NurbsSurface {
    /// The surface of `points`, each `(x, y, z, weight)` in metres: the control points of the first value of the second
    /// parameter first.
    ///
    /// # Errors
    /// [`Error::Argument`] if there is not one point per pair of splines; if a coordinate is not finite or beyond 1e14 m; if a
    /// weight is not between 1e-9 and 1e9; if a direction that is to be closed does not end where it began; if a whole patch
    /// between knots has no area.
    pub fn new(knots: [Knots; 2], closed: [bool; 2], points: &[DVec4]) -> Result<Self> {
        let [cols, rows] = [knots[0].controls(), knots[1].controls()];
        if points.len() != cols * rows || points.len() > Knots::MAX_CONTROLS {
            return Err(Error::argument(
                "the number of control points",
                points.len(),
                format!("{cols} × {rows}, as the knots say, and at most {}", Knots::MAX_CONTROLS),
            ));
        }
        Self::from_net(knots, closed, homogeneous(points)?)
    }

    /// From `(w x, w y, w z, w)`.
    fn from_net(knots: [Knots; 2], closed: [bool; 2], net: Vec<DVec4>) -> Result<Self> {
        check_weights(&net)?;
        let surface = Self { knots, closed, net };
        for axis in [0, 1] {
            let [first, last] = surface.edges(axis);
            if closed[axis] && !coincide(&first, &last, surface.size()) {
                let name = ["first", "second"][axis];
                return Err(Error::argument(
                    format!("the end of the surface in the closed {name} direction"),
                    "not its beginning",
                    "the same line",
                ));
            }
        }
        surface.check_patches()?;
        Ok(surface)
    }

    /// The knots of both parameters.
    #[must_use]
    pub fn knots(&self) -> &[Knots; 2] {
        &self.knots
    }

    /// Which directions are closed.
    #[must_use]
    pub fn closed(&self) -> [bool; 2] {
        self.closed
    }

    /// The control points, each `(x, y, z, weight)`, in the order of [`new`](Self::new).
    pub fn points(&self) -> impl Iterator<Item = DVec4> + '_ {
        self.net.iter().map(|p| (p.xyz() / p.w).extend(p.w))
    }

    /// Length of the diagonal of the box around the control points, m.
    #[must_use]
    pub fn size(&self) -> f64 {
        size(&self.net)
    }

    /// The point at a parameter and its derivatives by the parameters: one-sided at knots where they jump.
    /// In a direction that is not closed, a parameter is moved into the domain.
    #[must_use]
    pub fn jet(&self, u: DVec2) -> SurfaceJet {
        let [u1, u2] = [0, 1].map(|axis| self.knots[axis].basis(self.wrapped(axis, u[axis])));
        let first = u1.first;
        self.jet_on(&u1, &self.line(&u2, first..first + self.knots[0].degree() + 1))
    }

    /// Jets along the first parameter, where its splines are `columns`, at one value of the second.
    fn row_jets<'a>(
        &'a self,
        columns: &'a [Basis],
        u2: f64,
    ) -> impl Iterator<Item = SurfaceJet> + 'a {
        let least = columns.iter().map(|basis| basis.first).min().unwrap_or(0);
        let most = columns.iter().map(|basis| basis.first).max().unwrap_or(0);
        let controls = least..most + self.knots[0].degree() + 1;
        let line = self.line(&self.knots[1].basis(self.wrapped(1, u2)), controls);
        columns.iter().map(move |basis| self.jet_on(basis, &line[basis.first - least..]))
    }

    /// In a closed direction the parameter in the domain that stands for `u`.
    fn wrapped(&self, axis: usize, u: f64) -> f64 {
        let [from, to] = self.knots[axis].domain();
        if self.closed[axis] { from + (u - from).rem_euclid(to - from) } else { u }
    }

    /// Control points, in columns `cols`, of the line of constant second parameter, and their derivatives by it.
    fn line(&self, u2: &Basis, cols: std::ops::Range<usize>) -> Vec<[DVec4; 3]> {
        let stride = self.knots[0].controls();
        cols.map(|col| {
            let mut sums = [DVec4::ZERO; 3];
            for (j, of) in u2.of.iter().enumerate().take(self.knots[1].degree() + 1) {
                let p = self.net[(u2.first + j) * stride + col];
                for (sum, n) in sums.iter_mut().zip(of) {
                    *sum += *n * p;
                }
            }
            sums
        })
        .collect()
    }

    /// The jet on a line whose control points begin with the first that bears on it. The quotient rule for `S = A/w` (The NURBS
    /// Book, equation 4.20): `S_1 = (A_1 − w_1 S)/w`, `S_12 = (A_12 − w_1 S_2 − w_2 S_1 − w_12 S)/w`.
    fn jet_on(&self, u1: &Basis, line: &[[DVec4; 3]]) -> SurfaceJet {
        let [mut a, mut a1, mut a2, mut a11, mut a12, mut a22] = [DVec4::ZERO; 6];
        for ([p, p2, p22], &[n, n1, n2]) in line.iter().zip(&u1.of).take(self.knots[0].degree() + 1)
        {
            a += n * *p;
            a1 += n1 * *p;
            a11 += n2 * *p;
            a2 += n * *p2;
            a12 += n1 * *p2;
            a22 += n * *p22;
        }
        let inverse = a.w.recip();
        let point = a.xyz() * inverse;
        let first = [a1, a2].map(|a| (a.xyz() - a.w * point) * inverse);
        let w = [a1.w, a2.w];
        let second = [(a11, 0, 0), (a12, 0, 1), (a22, 1, 1)]
            .map(|(a, i, j)| (a.xyz() - w[i] * first[j] - w[j] * first[i] - a.w * point) * inverse);
        SurfaceJet { point, first, second }
    }

    /// The same surface with one more knot, at `u`, in a direction (0 or 1).
    ///
    /// # Errors
    /// [`Error::Argument`] for a `u` that is not inside the domain or is a knot of full multiplicity already.
    ///
    /// # Panics
    /// If the direction is not 0 or 1.
    pub fn with_knot(&self, direction: usize, u: f64) -> Result<Self> {
        let (knots, shares) = self.knots[direction].inserted(u)?;
        Ok(self.with_lines(direction, knots, |line| curve::inserted(line, &shares)))
    }

    /// The same surface on other parameters: the one of `direction` (0 or 1) goes through the Möbius map
    /// `t = c s/(1 + (c − 1) s)`, `s` and `t` running from 0 to 1 over the domain. The nodes of a grid then gather at the end
    /// for a ratio `c` below 1, at the beginning for one above; their density changes by `c²` from end to end.
    ///
    /// # Errors
    /// [`Error::Argument`] for a ratio that is not above 0, or so far from 1 that weights leave their range or a knot outside the
    /// domain goes to infinity.
    ///
    /// # Panics
    /// If the direction is not 0 or 1.
    pub fn reweighted(&self, direction: usize, ratio: f64) -> Result<Self> {
        let (knots, factors) = self.knots[direction].moebius(ratio)?;
        let surface = self.with_lines(direction, knots, |line| {
            line.iter().zip(&factors).map(|(p, f)| p * f).collect()
        });
        check_weights(&surface.net)?;
        Ok(surface)
    }

    /// The surface with each line of control points along a direction changed.
    fn with_lines(
        &self,
        axis: usize,
        knots: Knots,
        change: impl Fn(&[DVec4]) -> Vec<DVec4>,
    ) -> Self {
        let cols = self.knots[0].controls();
        let net = if axis == 0 {
            self.net.chunks(cols).flat_map(change).collect()
        } else {
            let columns = transposed(&self.net, cols);
            let changed: Vec<DVec4> =
                columns.chunks(self.knots[1].controls()).flat_map(change).collect();
            transposed(&changed, knots.controls())
        };
        let mut all = self.knots.clone();
        all[axis] = knots;
        Self { knots: all, net, closed: self.closed }
    }

    /// Control points of the lines at both ends of a direction.
    fn edges(&self, axis: usize) -> [Vec<DVec4>; 2] {
        let cols = self.knots[0].controls();
        self.knots[axis].domain().map(|u| {
            let basis = self.knots[axis].basis(u);
            // From one control point to the next along the direction, and along the edge.
            let (step, along) = if axis == 0 { (1, cols) } else { (cols, 1) };
            let control = |k: usize, i: usize| self.net[k * along + (basis.first + i) * step];
            (0..self.knots[1 - axis].controls())
                .map(|k| {
                    (0..=self.knots[axis].degree()).map(|i| basis.of[i][0] * control(k, i)).sum()
                })
                .collect()
        })
    }

    /// Whether a patch that is `by` parameters large, with the steps that the surface makes at `u`, has sides longer than `least`.
    fn has_area(&self, u: DVec2, by: DVec2, least: f64) -> bool {
        let jet = self.jet(u);
        let [a, b] = jet.first.map(|s| s.length());
        jet.is_regular() && a * by.x > least && b * by.y > least
    }

    /// Refuses a surface with a patch between knots that has no area.
    ///
    /// # Errors
    /// There is one.
    fn check_patches(&self) -> Result<()> {
        /// Where in a patch its area is looked at, as shares of its sides.
        const PLACES: [f64; 3] = [0.5, 0.2, 0.8];
        let least = SMALL * self.size();
        for [from2, to2] in self.knots[1].spans() {
            for [from1, to1] in self.knots[0].spans() {
                let (from, by) = (DVec2::new(from1, from2), DVec2::new(to1 - from1, to2 - from2));
                let mut places = PLACES.iter().flat_map(|&y| PLACES.map(|x| DVec2::new(x, y)));
                if !places.any(|at| self.has_area(from + at * by, by, least)) {
                    return Err(Error::argument(
                        format!(
                            "the area between the knots {from1} and {to1} of the first parameter, {from2} and {to2} of \
                             the second"
                        ),
                        0,
                        "above 0",
                    ));
                }
            }
        }
        Ok(())
    }
}

/// `(x, y, z, w)` as `(w x, w y, w z, w)`.
///
/// # Errors
/// Numbers out of range.
fn homogeneous(points: &[DVec4]) -> Result<Vec<DVec4>> {
    let fits = |p: &DVec4| p.xyz().abs().max_element() <= FARTHEST && p.is_finite();
    if let Some(i) = points.iter().position(|p| !fits(p)) {
        return Err(Error::argument(
            format!("control point {i}"),
            format!("at {:?} with weight {:?}", points[i].xyz().to_array(), points[i].w),
            format!("finite and at most {FARTHEST:e} m from the origin"),
        ));
    }
    let net = points.iter().map(|p| (p.xyz() * p.w).extend(p.w)).collect();
    Ok(net)
}

/// Refuses weights out of range.
///
/// # Errors
/// There is one.
fn check_weights(net: &[DVec4]) -> Result<()> {
    match net.iter().position(|p| !(LIGHTEST..=LIGHTEST.recip()).contains(&p.w)) {
        Some(i) => Err(Error::argument(
            format!("the weight of control point {i}"),
            format!("{:?}", net[i].w),
            format!("between {LIGHTEST:.0e} and {:.0e}", LIGHTEST.recip()),
        )),
        None => Ok(()),
    }
}

/// Length of the diagonal of the box around points.
fn size(net: &[DVec4]) -> f64 {
    let points = || net.iter().map(|p| p.xyz() / p.w);
    let least = points().fold(DVec3::INFINITY, DVec3::min);
    let most = points().fold(DVec3::NEG_INFINITY, DVec3::max);
    least.distance(most)
}

/// Whether two lines of control points on the same knots are the same but for a common factor and rounding.
fn coincide(a: &[DVec4], b: &[DVec4], size: f64) -> bool {
    let factor = a[0].w / b[0].w;
    a.iter().zip(b).all(|(a, b)| {
        (a.w / (b.w * factor) - 1.0).abs() <= SMALL
            && (a.xyz() / a.w).distance(b.xyz() / b.w) <= SMALL * size
    })
}

/// Rows of `cols` as columns.
fn transposed(net: &[DVec4], cols: usize) -> Vec<DVec4> {
    (0..cols).flat_map(|col| net[col..].iter().step_by(cols).copied()).collect()
}

#[cfg(test)]
mod tests;
