//! Separable least squares: rows, then columns.
//!
//! Along each axis the fit minimises
//!
//! ```text
//!   Σ_i (s(i) − z_i)² + λ ∫ s‴(t)² dt ,     t in nodes
//! ```
//!
//! A wave `sin ωt` keeps the share `1/(1 + λω⁶)` of its amplitude, so `λ = (L/2π)⁶` halves the waves of
//! length `L`; for waves of a few cells the spline's own symbols stand in for `ω⁶`.
//!
//! The third derivative is penalised for both degrees. The usual smoothing spline of degree 3 penalises
//! the second; its solution has `s″ = 0` at the border, so that curvature is lost there whatever the terrain.
//! Error of `s″` relative to its size, for waves `ℓ` of any phase and a cut-off of 16 cells, and `s″` of
//! unit noise (degree 3; degree 5 differs by little):
//!
//! | cells from the border | 0 | 2 | 4 | 8 | 16 | far |
//! |---|---|---|---|---|---|---|
//! | `∫ s″²`, `ℓ` = 80 | 1.01 | 0.73 | 0.38 | 0.019 | 0.011 | 0.0011 |
//! | `∫ s‴²`, `ℓ` = 80 | 0.37 | 0.21 | 0.09 | 0.025 | 0.004 | 0.0005 |
//! | `∫ s″²`, `ℓ` = 160 | 1.02 | 0.72 | 0.37 | 0.009 | 0.012 | < 0.0001 |
//! | `∫ s‴²`, `ℓ` = 160 | 0.18 | 0.11 | 0.04 | 0.012 | 0.002 | 0.0001 |
//! | `∫ s″²`, noise | 0.006 | 0.028 | 0.035 | 0.032 | 0.031 | 0.030 |
//! | `∫ s‴²`, noise | 0.059 | 0.057 | 0.049 | 0.024 | 0.023 | 0.023 |

use std::borrow::Cow;
use std::f64::consts::TAU;
use std::ops::Range;

use glam::DVec2;
use rayon::prelude::*;

use super::banded::{Banded, Ldl};
use super::basis::{Basis, Local, SUPPORT};
use super::knots::FitPlan;
use crate::control::Control;
use crate::error::Result;
use crate::grid::GridFrame;
use crate::linalg::simd::{self, Kernel};

/// Name of the stage in progress reports.
const STAGE: &str = "fitting surface";

/// Longest cut-off in knot intervals. It bounds the condition of the normal equations at about `10⁹`. It
/// is met only by cut-offs of over twelve times the extent of the grid, where all is a quadratic anyway, and in
/// rows towards a pole whose cells are less than a quarter as wide as the widest.
const LONGEST_CUTOFF: f64 = 64.0;

/// Columns, or rows, that are solved together.
pub(in crate::surface) const LANES: usize = 16;

/// Relative difference of cut-offs up to which rows share one: a wave at the cut-off keeps 0.5 ± 0.0015 of its amplitude.
const SHARED_CUTOFF_TOLERANCE: f64 = 1e-3;

/// Splines along one axis and their values at the nodes.
#[derive(Clone, Debug)]
pub(in crate::surface) struct Axis {
    pub(in crate::surface) basis: Basis,
    pub(in crate::surface) nodes: Vec<Local>,
    /// Nodes around the middle one that have its weights, each one coefficient further on than the node before.
    pub(in crate::surface) uniform: Range<usize>,
    /// The weights half-way between a node and the next, at the middles of cells.
    pub(in crate::surface) centres: Vec<Local>,
    /// As `uniform`, of the middles.
    pub(in crate::surface) uniform_centres: Range<usize>,
    /// `Σ_i v_i v_iᵀ` with `v_i` the weights at node `i`.
    gram: Banded,
}

impl Axis {
    pub(in crate::surface) fn new(degree: usize, nodes: usize, intervals: usize) -> Self {
        let basis = Basis::new(degree, nodes, intervals);
        let nodes: Vec<Local> = (0..nodes).map(|i| basis.at(i as f64)).collect();
        let mut gram = Banded::zero(basis.len());
        for node in &nodes {
            gram.add_outer(node.start, &node.weights[0][..basis.support()], 1.0);
        }
        let last = nodes.len() as f64 - 1.0;
        let centre = |i: usize| basis.at((i as f64 + 0.5).min(last));
        let centres: Vec<Local> = (0..nodes.len()).map(centre).collect();
        let (uniform, uniform_centres) = (uniform(&nodes), uniform(&centres));
        Self { basis, nodes, uniform, centres, uniform_centres, gram }
    }

    /// Matrix of `∫ (d^order s/dt^order)² dt`, by Gauss's three points per interval: exact to degree 5.
    pub(in crate::surface) fn penalty(&self, order: usize) -> Banded {
        const GAUSS: [(f64, f64); 3] = [
            (0.112_701_665_379_258_3, 5.0 / 18.0),
            (0.5, 8.0 / 18.0),
            (0.887_298_334_620_741_7, 5.0 / 18.0),
        ];
        let mut penalty = Banded::zero(self.basis.len());
        for k in 0..self.basis.intervals() {
            for (u, share) in GAUSS {
                let local = self.basis.at((k as f64 + u) / self.basis.density());
                let weights = &local.weights[order][..self.basis.support()];
                penalty.add_outer(local.start, weights, share / self.basis.density());
            }
        }
        penalty
    }

    /// A cut-off of `cells` nodes, kept where the equations are sound.
    pub(in crate::surface) fn cutoff(&self, cells: f64) -> f64 {
        // Fewer knots than nodes without smoothing may leave a coefficient almost without data where
        // nodes fall midway between knots; a cut-off of 0.3 intervals holds it and changes nothing otherwise.
        let shortest = if self.basis.len() < self.nodes.len() { 0.3 } else { 0.0 };
        cells.clamp(shortest / self.basis.density(), LONGEST_CUTOFF / self.basis.density())
    }

    /// `λ` for a cut-off of `cells` nodes: the quotient of the symbols of normal and penalty matrix at that wave,
    ///
    /// ```text
    ///   λ = b(ω)² / ((2 sin ω/2)⁶ r(ω)) ,     b(ω) = Σ_k N(k) cos kω ,     ω = 2π/L per knot
    /// ```
    ///
    /// with `r = 1` for degree 3 and `r = b` for degree 5, from third differences and the products of the
    /// B-splines they are coefficients of. For long waves it is `(L/2π)⁶`.
    fn smoothing(&self, cells: f64) -> f64 {
        let cutoff = self.cutoff(cells) * self.basis.density();
        // No wave on the knots is shorter than two of them.
        let wave = cutoff.max(2.0);
        let omega = TAU / wave;
        let values = if self.basis.degree() == 3 {
            (2.0 + omega.cos()) / 3.0
        } else {
            (33.0 + 26.0 * omega.cos() + (2.0 * omega).cos()) / 60.0
        };
        let r = if self.basis.degree() == 3 { 1.0 } else { values };
        let lambda = values * values / ((2.0 * (omega / 2.0).sin()).powi(6) * r);
        lambda * (cutoff / wave / self.basis.density()).powi(6)
    }

    /// Factors of the normal matrix for a cut-off of `cells` nodes.
    fn normal(&self, penalty: &Banded, cells: f64) -> Ldl {
        let mut normal = self.gram.clone();
        normal.add(penalty, self.smoothing(cells));
        normal.factor(self.basis.support() - 1)
    }

    /// Trace of the matrix that takes heights to fitted heights.
    pub(in crate::surface) fn trace(&self, cells: f64) -> f64 {
        let inverse = self.normal(&self.penalty(3), cells).inverse_band();
        self.nodes.iter().map(|node| self.leverage(node, &inverse)).sum()
    }

    /// Share of a node's height in its fitted height, `vᵀ N⁻¹ v` with `v` the weights at the node, from the band of `N⁻¹`.
    fn leverage(&self, node: &Local, inverse: &[[f64; SUPPORT]]) -> f64 {
        let weights = &node.weights[0][..self.basis.support()];
        let entry = |i: usize, j: usize| inverse[node.start + i.max(j)][i.abs_diff(j)];
        let row = |i: usize| (0..weights.len()).map(move |j| weights[j] * entry(i, j));
        (0..weights.len()).map(|i| weights[i] * row(i).sum::<f64>()).sum()
    }

    /// Right-hand side of the normal equations: `Σ_i v_i z_i`.
    fn project<const W: usize>(&self, heights: &[[f64; W]]) -> Vec<[f64; W]> {
        let (nodes, coefficients) = (&self.nodes, self.basis.len());
        // The weights beyond a narrow grid's support are 0, but what they are added to must exist.
        let mut sums = match self.basis.support() {
            4 => simd::dispatch(Project::<4, W> { nodes, heights, coefficients }),
            _ => simd::dispatch(Project::<SUPPORT, W> { nodes, heights, coefficients }),
        };
        sums.truncate(coefficients);
        sums
    }

    /// Heights at all nodes of the fit to the finite heights of a line; `penalty` is that of the
    /// derivative `order`.
    pub(in crate::surface) fn complete(
        &self,
        penalty: &Banded,
        order: i32,
        cells: f64,
        line: &[f64],
    ) -> Vec<f64> {
        let support = self.basis.support();
        let mut normal = Banded::zero(self.basis.len());
        let mut x = vec![[0.0]; self.basis.len()];
        for (node, z) in self.nodes.iter().zip(line).filter(|(_, z)| z.is_finite()) {
            let weights = &node.weights[0][..support];
            normal.add_outer(node.start, weights, 1.0);
            x[node.start..].iter_mut().zip(weights).for_each(|([x], w)| *x += w * z);
        }
        normal.add(penalty, (self.cutoff(cells) / TAU).powi(2 * order));
        normal.factor(support - 1).solve(&mut x);
        let x = x.as_flattened();
        self.nodes.iter().map(|n| dot(&n.weights[0][..support], &x[n.start..])).collect()
    }
}

/// At least `coefficients` sums `Σ_i v_i z_i` of heights with the first `N` weights at their nodes.
struct Project<'a, const N: usize, const W: usize> {
    nodes: &'a [Local],
    heights: &'a [[f64; W]],
    coefficients: usize,
}

impl<const N: usize, const W: usize> Kernel for Project<'_, N, W> {
    type Output = Vec<[f64; W]>;

    #[inline(always)]
    fn run(self) -> Self::Output {
        let Self { nodes, heights, coefficients } = self;
        let mut sums = vec![[0.0; W]; if coefficients > N { coefficients } else { N }];
        for (node, z) in nodes.iter().zip(heights) {
            let sums = &mut sums[node.start..node.start + N];
            for (sum, weight) in sums.iter_mut().zip(&node.weights[0]) {
                for i in 0..W {
                    sum[i] += weight * z[i];
                }
            }
        }
        sums
    }
}

/// Coefficients of a tensor-product spline, row-major, and its two axes.
#[derive(Clone, Debug)]
pub(in crate::surface) struct Fit {
    pub(in crate::surface) x: Axis,
    pub(in crate::surface) y: Axis,
    pub(in crate::surface) coefficients: Vec<f64>,
}

impl Fit {
    /// Fits heights without voids.
    pub(in crate::surface) fn new(
        frame: &GridFrame,
        heights: &[f64],
        plan: &FitPlan,
        control: &Control,
    ) -> Result<Self> {
        let x = Axis::new(plan.degree, frame.cols(), plan.intervals[0]);
        let y = Axis::new(plan.degree, frame.rows(), plan.intervals[1]);
        let width = x.basis.len();
        control.report(STAGE, 0.0);
        let mut coefficients = vec![0.0; frame.rows() * width];
        solve_rows(frame, &x, plan.cutoff, heights, &mut coefficients, control)?;
        control.report(STAGE, 0.5);
        let cells = plan.cutoff / frame.mid_spacing().y;
        solve_columns(&y, cells, &mut coefficients, width, control)?;
        coefficients.truncate(width * y.basis.len());
        coefficients.shrink_to_fit();
        control.report(STAGE, 1.0);
        Ok(Self { x, y, coefficients })
    }

    /// Values at the nodes of a row.
    pub(in crate::surface) fn row_values(&self, row: usize, values: &mut [f64]) {
        let (width, support) = (self.x.basis.len(), self.x.basis.support());
        let node = &self.y.nodes[row];
        let mut line = vec![0.0; width];
        for (k, weight) in node.weights[0][..self.y.basis.support()].iter().enumerate() {
            let coefficients = &self.coefficients[(node.start + k) * width..][..width];
            line.iter_mut().zip(coefficients).for_each(|(sum, c)| *sum += weight * c);
        }
        let value = |node: &Local| dot(&node.weights[0][..support], &line[node.start..]);
        let uniform = self.x.uniform.clone();
        for col in (0..uniform.start).chain(uniform.end..values.len()) {
            values[col] = value(&self.x.nodes[col]);
        }
        let Some(node) = self.x.nodes.get(uniform.start) else { return };
        let windows = line[node.start..].windows(support);
        for (value, window) in values[uniform].iter_mut().zip(windows) {
            *value = dot(&node.weights[0][..support], window);
        }
    }

    /// `z` differentiated `orders[k]` times along columns and rows, per node, at grid coordinates `at`.
    pub(in crate::surface) fn derivatives<const K: usize>(
        &self,
        at: DVec2,
        orders: [[usize; 2]; K],
    ) -> [f64; K] {
        let (x, y) = (self.x.basis.at(at.x), self.y.basis.at(at.y));
        let support = self.x.basis.support();
        orders.map(|[i, j]| {
            (0..self.y.basis.support())
                .map(|k| {
                    let line = &self.coefficients[(y.start + k) * self.x.basis.len() + x.start..];
                    y.weights[j][k] * dot(&x.weights[i][..support], line)
                })
                .sum()
        })
    }
}

/// See [`Axis::uniform`]; empty if there are no nodes.
fn uniform(nodes: &[Local]) -> Range<usize> {
    let middle = nodes.len() / 2;
    let like = |&i: &usize| {
        nodes[i].weights == nodes[middle].weights
            && nodes[i].start + middle == nodes[middle].start + i
    };
    let first = (0..middle).rev().take_while(like).last().unwrap_or(middle);
    first..(middle..nodes.len()).take_while(like).last().map_or(middle, |last| last + 1)
}

pub(in crate::surface) fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Fits every row of heights: as many rows of `coefficients`.
///
/// [`LANES`] rows are solved together. Where meridians converge their cells differ in width; they share the cut-off in
/// cells of the middle one if that changes none by more than [`SHARED_CUTOFF_TOLERANCE`].
fn solve_rows(
    frame: &GridFrame,
    axis: &Axis,
    cutoff: f64,
    heights: &[f64],
    coefficients: &mut [f64],
    control: &Control,
) -> Result<()> {
    let (cols, width) = (frame.cols(), axis.basis.len());
    let cells = |row: usize| if cutoff > 0.0 { cutoff / frame.spacing(row as f64).x } else { 0.0 };
    let penalty = axis.penalty(3);
    let top = axis.normal(&penalty, cells(0));
    let normal = |cells_there: f64| match cells_there == cells(0) {
        true => Cow::Borrowed(&top),
        false => Cow::Owned(axis.normal(&penalty, cells_there)),
    };
    let groups = heights.par_chunks(LANES * cols).zip(coefficients.par_chunks_mut(LANES * width));
    groups.enumerate().try_for_each(|(group, (heights, coefficients))| {
        control.check()?;
        let (first, count) = (group * LANES, heights.len() / cols);
        let shared = cells(first + count / 2);
        let spread = (cells(first) - shared).abs().max((cells(first + count - 1) - shared).abs());
        if spread <= SHARED_CUTOFF_TOLERANCE * shared {
            solve_lines::<LANES>(axis, &normal(shared), heights, coefficients);
        } else {
            let rows = heights.chunks(cols).zip(coefficients.chunks_mut(width));
            for (i, (heights, coefficients)) in rows.enumerate() {
                solve_lines::<1>(axis, &normal(cells(first + i)), heights, coefficients);
            }
        }
        Ok(())
    })
}

/// Fits at most `W` rows side by side.
fn solve_lines<const W: usize>(
    axis: &Axis,
    normal: &Ldl,
    heights: &[f64],
    coefficients: &mut [f64],
) {
    let mut lanes = vec![[0.0; W]; axis.nodes.len()];
    for (i, row) in heights.chunks(axis.nodes.len()).enumerate() {
        lanes.iter_mut().zip(row).for_each(|(lanes, z)| lanes[i] = *z);
    }
    let mut x = axis.project(&lanes);
    normal.solve(&mut x);
    for (i, row) in coefficients.chunks_mut(x.len()).enumerate() {
        row.iter_mut().zip(&x).for_each(|(coefficient, lanes)| *coefficient = lanes[i]);
    }
}

/// Fits every column; its coefficients take the place of its first values.
fn solve_columns(
    axis: &Axis,
    cells: f64,
    values: &mut [f64],
    width: usize,
    control: &Control,
) -> Result<()> {
    let normal = axis.normal(&axis.penalty(3), cells);
    stripes(values, width).into_par_iter().try_for_each(|mut stripe| {
        control.check()?;
        let mut lines = vec![[0.0; LANES]; stripe.len()];
        for (lanes, piece) in lines.iter_mut().zip(&stripe) {
            lanes[..piece.len()].copy_from_slice(piece);
        }
        let mut x = axis.project(&lines);
        normal.solve(&mut x);
        for (piece, lanes) in stripe.iter_mut().zip(&x) {
            piece.copy_from_slice(&lanes[..piece.len()]);
        }
        Ok(())
    })
}

/// Stripes of [`LANES`] columns as lists of row pieces, so that threads can write them without overlap.
pub(in crate::surface) fn stripes(values: &mut [f64], width: usize) -> Vec<Vec<&mut [f64]>> {
    let rows = values.len() / width;
    let mut stripes: Vec<_> =
        (0..width.div_ceil(LANES)).map(|_| Vec::with_capacity(rows)).collect();
    for row in values.chunks_mut(width) {
        for (stripe, piece) in stripes.iter_mut().zip(row.chunks_mut(LANES)) {
            stripe.push(piece);
        }
    }
    stripes
}
