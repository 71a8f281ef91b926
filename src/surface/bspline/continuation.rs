//! The ground continued a little into voids, by local polynomials.
//!
//! Around a knot near voids the polynomial `q` minimises
//!
//! ```text
//!   Σ_i (q(x_i) − z_i)² / d_i⁴ ,     d_i the distance of height i from the knot in knot intervals
//! ```
//!
//! over the heights in a window (moving least squares; Lancaster and Salkauskas, Math. Comp. 37, 1981). Its degree is the
//! highest that the heights determine, up to that of the polynomials which the fit keeps: these are continued exactly, and what is
//! smooth to as high an order.

use std::collections::HashMap;
use std::ops::Range;

use glam::DVec2;
use rayon::prelude::*;

use super::domain::{Domain, nearest_nodes};
use super::knots::FitPlan;
use crate::control::Control;
use crate::error::Result;
use crate::grid::GridFrame;
use crate::linalg::simd::{self, Kernel};

/// How far beyond the margin the window reaches, in knot intervals: it must see past single noisy heights.
const DEPTH: usize = 5;

/// Half-width of the window in small holes, where at least half of its nodes have heights, in knot intervals. There the weights
/// are `1/d⁸`: error of the curvature next to pits in an interpolated DEM, relative to its root mean square, 0.14 and 0.16 on
/// Aconcagua and Big Tujunga, and 0.25 and 0.24 with `1/d⁴`.
const NARROW: f64 = 5.0;

/// Heights for two coefficients, at least: fewer follow noise.
const HEIGHTS_PER_TWO: usize = 3;

/// A coefficient is left out if the heights determine it no better than this, relative to what they would if those of
/// lower degree were known.
const UNDETERMINED: f64 = 1e-9;

/// Most coefficients: degree 5.
const MOST: usize = 21;

/// The heights of a terrain, and those of its voids near them.
pub(in crate::surface) struct Continued<'a> {
    heights: &'a [f64],
    cols: usize,
    /// Of each row the heights in the voids of a domain, from west to east; empty if nothing is void.
    voids: Vec<Vec<f64>>,
}

impl<'a> Continued<'a> {
    /// Heights without voids.
    pub(in crate::surface) fn whole(heights: &'a [f64], cols: usize) -> Self {
        Self { heights, cols, voids: Vec::new() }
    }

    /// Continues heights to all nodes in a domain.
    pub(in crate::surface) fn new(
        frame: &GridFrame,
        heights: &'a [f64],
        plan: &FitPlan,
        margin: usize,
        domain: &Domain,
        control: &Control,
    ) -> Result<Self> {
        let degree = if plan.cutoff > 0.0 { 2 } else { plan.degree };
        // One knot: no node is far from it.
        let density = plan.density(frame).max(DVec2::splat(1e-9));
        let (cols, rows) = (frame.cols(), frame.rows());
        let half_width = (margin + DEPTH) as f64;
        let [low, high] = range(heights);
        // Where knots are far apart, polynomials run far beyond the ground.
        let is_dense = density == DVec2::ONE;
        let beyond = if is_dense { f64::INFINITY } else { 0.75 * (high - low) };
        let bounds = [low - beyond, high + beyond];
        let window = Window { heights, cols, density, half_width, degree, bounds };
        let voids: Vec<Vec<Vec<f64>>> = (0..=plan.intervals[1])
            .into_par_iter()
            .map(|knot| {
                control.check()?;
                Ok(window.voids_near(knot, nearest_nodes(knot, density.y, rows), domain))
            })
            .collect::<Result<_>>()?;
        Ok(Self { heights, cols, voids: voids.into_iter().flatten().collect() })
    }

    /// Each row of heights, and those of its voids.
    pub(in crate::surface) fn rows_mut(
        &mut self,
    ) -> impl IndexedParallelIterator<Item = (&'a [f64], &mut [f64])> {
        self.heights.par_chunks(self.cols).zip(self.voids.par_iter_mut().map(Vec::as_mut_slice))
    }

    /// A row, to be read from west to east.
    pub(in crate::surface) fn row(&self, row: usize) -> ContinuedRow<'_> {
        ContinuedRow {
            heights: &self.heights[row * self.cols..][..self.cols],
            voids: self.voids.get(row).map_or(&[], |voids| voids),
        }
    }
}

/// The rest of a row.
pub(in crate::surface) struct ContinuedRow<'a> {
    heights: &'a [f64],
    /// Heights of voids that are not read yet.
    voids: &'a [f64],
}

impl<'a> ContinuedRow<'a> {
    /// The heights in the next columns of the domain.
    pub(in crate::surface) fn heights(
        &mut self,
        cols: Range<usize>,
    ) -> impl Iterator<Item = f64> + use<'_, 'a> {
        self.heights[cols].iter().map(|&z| {
            if z.is_finite() {
                return z;
            }
            let Some((&next, rest)) = self.voids.split_first() else { return 0.0 };
            self.voids = rest;
            next
        })
    }
}

/// The heights around knots.
struct Window<'a> {
    heights: &'a [f64],
    cols: usize,
    /// Knots per node along each axis.
    density: DVec2,
    /// In knot intervals.
    half_width: f64,
    /// Of polynomials, at most.
    degree: usize,
    /// Of continued heights.
    bounds: [f64; 2],
}

impl Window<'_> {
    /// Heights of the voids in some rows of nodes, from west to east, by the polynomials of the nearest knots, which are in row `knot`.
    fn voids_near(&self, knot: usize, rows: Range<usize>, domain: &Domain) -> Vec<Vec<f64>> {
        let mut polynomials = HashMap::new();
        rows.map(|row| {
            let line = &self.heights[row * self.cols..][..self.cols];
            let nodes = domain.nodes_at(row, self.cols).into_iter().flatten();
            nodes
                .filter(|&col| !line[col].is_finite())
                .map(|col| {
                    let at = DVec2::new(col as f64, row as f64) * self.density;
                    let knot = DVec2::new(at.x.round(), knot as f64);
                    let polynomial =
                        polynomials.entry(knot.x as usize).or_insert_with(|| self.polynomial(knot));
                    polynomial.at(at - knot).clamp(self.bounds[0], self.bounds[1])
                })
                .collect()
        })
        .collect()
    }

    /// The polynomial of a knot.
    fn polynomial(&self, knot: DVec2) -> Polynomial {
        // Where knots are far apart not every height is needed, unless there are few.
        let strides = (0.5 / self.density).floor().clamp(DVec2::ONE, DVec2::splat(1e6));
        let strides = strides.to_array().map(|stride| stride as usize);
        let narrow = self.nodes(knot, NARROW, strides, 4);
        let about = narrow.origin(NARROW, self.degree);
        if 2 * narrow.moments(0, &about).count >= narrow.count() {
            return narrow.fit(about);
        }
        let mut nodes = self.nodes(knot, self.half_width, strides, 2);
        let mut origin = nodes.origin(self.half_width, self.degree);
        let mut sums = nodes.moments(1, &origin);
        if sums.count < 2 * MOST {
            nodes = self.nodes(knot, self.half_width, [1, 1], 2);
            origin = nodes.origin(self.half_width, self.degree);
            sums = nodes.moments(1, &origin);
        }
        let [[total, x, ..], [y, ..], ..] = sums.places;
        if total == 0.0 {
            return origin;
        }
        let degree = (0..=self.degree)
            .rev()
            .find(|&degree| HEIGHTS_PER_TWO * coefficients(degree) <= 2 * sums.count)
            .unwrap_or(0);
        let centre = DVec2::new(x, y) * (self.half_width / total);
        let mean = origin.mean + sums.heights[0][0] / total;
        nodes.fit(Polynomial { centre, mean, degree, ..origin })
    }

    /// The window around a knot, every so manyth column and row of it.
    fn nodes(&self, knot: DVec2, half_width: f64, strides: [usize; 2], fall: i32) -> Nodes<'_> {
        let counts = [self.cols, self.heights.len() / self.cols];
        let [cols, rows] = [0, 1].map(|axis| {
            let [first, last] =
                [-1.0, 1.0].map(|side| (knot[axis] + side * half_width) / self.density[axis]);
            let first = (first.max(0.0).ceil() as usize).next_multiple_of(strides[axis]);
            first..counts[axis].min((last as usize).saturating_add(1))
        });
        Nodes { window: self, knot, cols, rows, strides, fall }
    }
}

/// The nodes of a window around a knot, in every so manyth column and row.
struct Nodes<'a> {
    window: &'a Window<'a>,
    knot: DVec2,
    cols: Range<usize>,
    rows: Range<usize>,
    strides: [usize; 2],
    /// The weight of a height is the distance from the knot to the power of −2 `fall`.
    fall: i32,
}

impl Nodes<'_> {
    /// The constant that some height in the window is.
    fn origin(&self, scale: f64, degree: usize) -> Polynomial {
        let lines = self.rows.clone().map(|row| &self.window.heights[row * self.window.cols..]);
        let mut heights = lines.flat_map(|line| &line[self.cols.clone()]);
        let mean = heights.find(|z| z.is_finite()).copied().unwrap_or_default();
        Polynomial { scale, mean, degree, ..Polynomial::default() }
    }

    /// The least-squares polynomial of the degree of one of them.
    fn fit(&self, about: Polynomial) -> Polynomial {
        let mut fit = about;
        // The products of monomials of high degree lose digits, which a second solution, of what the first leaves, brings back.
        let solutions = if about.degree > 2 { 2 } else { 1 };
        for _ in 0..solutions {
            let more = self.moments(about.degree, &fit).solve(about.degree);
            fit.coefficients.iter_mut().zip(more).for_each(|(sum, more)| *sum += more);
        }
        fit
    }

    /// Their number.
    fn count(&self) -> usize {
        let [across, down] = self.strides;
        self.cols.len().div_ceil(across) * self.rows.len().div_ceil(down)
    }

    /// What polynomials of a degree need, about the centre of one and of what it leaves of the heights.
    fn moments(&self, degree: usize, about: &Polynomial) -> Moments {
        let nodes = self;
        match degree {
            0 | 1 => simd::dispatch(Sum::<1> { nodes, about }),
            2 => simd::dispatch(Sum::<2> { nodes, about }),
            3 => simd::dispatch(Sum::<3> { nodes, about }),
            _ => simd::dispatch(Sum::<5> { nodes, about }),
        }
    }
}

/// The moments for polynomials of degree `D`, over nodes side by side.
struct Sum<'a, const D: usize> {
    nodes: &'a Nodes<'a>,
    about: &'a Polynomial,
}

impl<const D: usize> Kernel for Sum<'_, D> {
    type Output = Moments;

    #[inline(always)]
    fn run(self) -> Moments {
        const LANES: usize = 8;
        let Nodes { window, knot, cols, rows, strides: [stride, down], fall } = self.nodes;
        let Polynomial { centre, scale, mean, coefficients, .. } = *self.about;
        let mut moments = Moments::default();
        for row in rows.clone().step_by(*down) {
            let line = &window.heights[row * window.cols..][..window.cols];
            let from_knot = row as f64 * window.density.y - knot.y;
            let y = (from_knot - centre.y) / scale;
            // The polynomial on the row, as one of x.
            let mut polynomial = [0.0; 5 + 1];
            let mut power = 1.0;
            for j in 0..=D {
                for i in 0..=D - j {
                    polynomial[i] += coefficients[(i + j) * (i + j + 1) / 2 + j] * power;
                }
                power *= y;
            }
            let mut places = [[0.0; LANES]; 2 * 5 + 1];
            let mut heights = [[0.0; LANES]; 5 + 1];
            let mut counts = [0.0; LANES];
            for first in cols.clone().step_by(LANES * stride) {
                let (mut z, mut x) = ([f64::NAN; LANES], [0.0; LANES]);
                for i in 0..LANES {
                    let col = first + i * stride;
                    x[i] = col as f64 * window.density.x - knot.x;
                    if col < cols.end {
                        z[i] = line[col];
                    }
                }
                for i in 0..LANES {
                    let (known, x) = (z[i].is_finite(), x[i]);
                    let near = (x * x + from_knot * from_knot).max(0.25);
                    let near = if *fall == 2 { near * near } else { near * near * near * near };
                    let x = (x - centre.x) / scale;
                    let mut left = z[i] - mean;
                    let mut term = 1.0;
                    for factor in &polynomial[..=D] {
                        left -= factor * term;
                        term *= x;
                    }
                    let mut of_place = if known { 1.0 / near } else { 0.0 };
                    let mut of_height = if known { of_place * left } else { 0.0 };
                    counts[i] += if known { 1.0 } else { 0.0 };
                    for sum in &mut places[..=2 * D] {
                        sum[i] += of_place;
                        of_place *= x;
                    }
                    for sum in &mut heights[..=D] {
                        sum[i] += of_height;
                        of_height *= x;
                    }
                }
            }
            moments.count += counts.iter().sum::<f64>() as usize;
            let mut power = 1.0;
            for j in 0..=2 * D {
                let line = moments.places[j].iter_mut().zip(&places).take(2 * D + 1 - j);
                line.for_each(|(sum, lanes)| *sum += power * lanes.iter().sum::<f64>());
                if j <= D {
                    let line = moments.heights[j].iter_mut().zip(&heights).take(D + 1 - j);
                    line.for_each(|(sum, lanes)| *sum += power * lanes.iter().sum::<f64>());
                }
                power *= y;
            }
        }
        moments
    }
}

/// Smallest and largest finite height.
fn range(heights: &[f64]) -> [f64; 2] {
    let finite = heights.par_iter().copied().filter(|z| z.is_finite());
    let none = || [f64::INFINITY, f64::NEG_INFINITY];
    finite
        .fold(none, |[a, b], z| [a.min(z), b.max(z)])
        .reduce(none, |[a, b], [c, d]| [a.min(c), b.max(d)])
}

/// Number of coefficients of the polynomials of a degree.
fn coefficients(degree: usize) -> usize {
    (degree + 1) * (degree + 2) / 2
}

/// Exponents of the monomials, by ascending degree.
fn monomials(degree: usize) -> impl Iterator<Item = [usize; 2]> {
    (0..=degree).flat_map(|degree| (0..=degree).map(move |j| [degree - j, j]))
}

/// The powers `1, t, … t^10`.
fn powers(t: f64) -> [f64; 11] {
    let mut powers = [1.0; 11];
    for i in 1..powers.len() {
        powers[i] = powers[i - 1] * t;
    }
    powers
}

/// Weighted sums over heights.
#[derive(Default)]
struct Moments {
    /// Number of heights.
    count: usize,
    /// `Σ w x^i y^j` at `[j][i]`.
    places: [[f64; 11]; 11],
    /// `Σ w z x^i y^j` at `[j][i]`.
    heights: [[f64; 6]; 6],
}

impl Moments {
    /// Coefficients of the least-squares polynomial, by factoring the normal matrix as `L D Lᵀ`; those that the heights do not determine
    /// are 0.
    fn solve(&self, degree: usize) -> [f64; MOST] {
        let mut exponents = [[0; 2]; MOST];
        exponents.iter_mut().zip(monomials(degree)).for_each(|(to, from)| *to = from);
        let n = coefficients(degree);
        let (mut lower, mut inverse) = ([[0.0; MOST]; MOST], [0.0; MOST]);
        let mut x = [0.0; MOST];
        for i in 0..n {
            let [a, b] = exponents[i];
            // Row i becomes L D, then L; x the solution of L x = b.
            for j in 0..=i {
                let [c, d] = exponents[j];
                let inner: f64 = (0..j).map(|k| lower[i][k] * lower[j][k] * inverse[k]).sum();
                lower[i][j] = self.places[b + d][a + c] - inner;
            }
            let diagonal = self.places[2 * b][2 * a];
            let pivot = lower[i][i];
            inverse[i] = if pivot > UNDETERMINED * diagonal { pivot.recip() } else { 0.0 };
            let inner: f64 = (0..i).map(|k| lower[i][k] * inverse[k] * x[k]).sum();
            x[i] = self.heights[b][a] - inner;
        }
        for i in (0..n).rev() {
            let inner: f64 = (i + 1..n).map(|k| lower[k][i] * x[k]).sum();
            x[i] = (x[i] - inner) * inverse[i];
        }
        x
    }
}

/// `mean + Σ c_ij X^i Y^j` with `(X, Y) = (at − centre)/scale`, `at` in knot intervals from the knot.
#[derive(Clone, Copy, Default)]
struct Polynomial {
    centre: DVec2,
    scale: f64,
    mean: f64,
    degree: usize,
    coefficients: [f64; MOST],
}

impl Polynomial {
    fn at(&self, at: DVec2) -> f64 {
        let at = (at - self.centre) / self.scale;
        let (x, y) = (powers(at.x), powers(at.y));
        let terms =
            monomials(self.degree).zip(self.coefficients).map(|([i, j], c)| c * x[i] * y[j]);
        self.mean + terms.sum::<f64>()
    }
}
