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
use super::continuation::Continued;
use super::domain::{Domain, nodes_of};
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
const LANES: usize = 16;

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
    /// Matrix of `∫ s‴(t)² dt`.
    penalty: Banded,
}

/// The normal equations of an axis.
#[derive(Clone)]
struct Normal<'a> {
    axis: &'a Axis,
    /// The cut-off in nodes.
    cells: f64,
    matrix: Banded,
    factors: Ldl,
}

/// The normal equations on a run of knots of an axis, whose ends are to them what those of the axis are to all of it.
struct Section<'a> {
    basis: Basis,
    /// The nodes between its ends.
    nodes: Range<usize>,
    /// The coefficients and weights at the first nodes, and at the last, whose coefficients here come by `moved` sooner.
    first: Cow<'a, [Local]>,
    last: &'a [Local],
    moved: usize,
    factors: Cow<'a, Ldl>,
}

impl Axis {
    pub(in crate::surface) fn new(degree: usize, nodes: usize, intervals: usize) -> Self {
        let basis = Basis::new(degree, nodes, intervals);
        let nodes: Vec<Local> = (0..nodes).map(|i| basis.at(i as f64)).collect();
        let penalty = penalty(&basis);
        let gram = gram(&basis, &nodes);
        let last = nodes.len() as f64 - 1.0;
        let centre = |i: usize| basis.at((i as f64 + 0.5).min(last));
        let centres: Vec<Local> = (0..nodes.len()).map(centre).collect();
        let (uniform, uniform_centres) = (uniform(&nodes), uniform(&centres));
        Self { basis, nodes, uniform, centres, uniform_centres, gram, penalty }
    }

    /// A cut-off of `cells` nodes, kept where the equations are sound.
    fn cutoff(&self, cells: f64) -> f64 {
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

    /// The normal equations for a cut-off of `cells` nodes.
    fn normal(&self, cells: f64) -> Normal<'_> {
        let mut matrix = self.gram.clone();
        matrix.add(&self.penalty, self.smoothing(cells));
        let factors = matrix.clone().factor(self.basis.support() - 1);
        Normal { axis: self, cells, matrix, factors }
    }

    /// Trace of the matrix that takes heights to fitted heights.
    pub(in crate::surface) fn trace(&self, cells: f64) -> f64 {
        let inverse = self.normal(cells).factors.inverse_band();
        self.nodes.iter().map(|node| self.leverage(node, &inverse)).sum()
    }

    /// Share of a node's height in its fitted height, `vᵀ N⁻¹ v` with `v` the weights at the node, from the band of `N⁻¹`.
    fn leverage(&self, node: &Local, inverse: &[[f64; SUPPORT]]) -> f64 {
        let weights = &node.weights[0][..self.basis.support()];
        let entry = |i: usize, j: usize| inverse[node.start + i.max(j)][i.abs_diff(j)];
        let row = |i: usize| (0..weights.len()).map(move |j| weights[j] * entry(i, j));
        (0..weights.len()).map(|i| weights[i] * row(i).sum::<f64>()).sum()
    }
}

impl Normal<'_> {
    /// The equations on a run of the knots.
    fn section(&self, run: &Range<usize>) -> Section<'_> {
        let Self { axis, cells, matrix, factors } = self;
        let (basis, locals) = (axis.basis.section(run), &axis.nodes);
        let nodes = nodes_of(run, basis.density(), locals.len());
        if run.len() == axis.basis.len() {
            let (first, factors) = (Cow::Borrowed(&locals[..]), Cow::Borrowed(factors));
            return Section { basis, nodes, first, last: &[], moved: 0, factors };
        }
        // Knots this near an end know of it.
        let ends = basis.degree() + 1;
        let is_short = run.len() < 2 * ends;
        if axis.basis.len() == locals.len() && !is_short {
            // With a knot at every node all inner equations are alike: those of all knots, less some in the middle.
            let moved = locals.len() - run.len();
            let first = Cow::Borrowed(&locals[..run.len() - ends]);
            let last = &locals[locals.len() - ends..];
            let factors = Cow::Owned(factors.shortened(matrix, run.len(), ends));
            return Section { basis, nodes, first, last, moved, factors };
        }
        let is_inner = |local: &Local| {
            basis.support() == axis.basis.support()
                && local.start >= run.start
                && local.start + basis.support() <= run.end
        };
        let first: Vec<_> = nodes
            .clone()
            .map(|i| match &locals[i] {
                local if is_inner(local) => Local { start: local.start - run.start, ..*local },
                _ => basis.at(i as f64),
            })
            .collect();
        let penalty = match is_short {
            true => penalty(&basis),
            false => axis.penalty.shortened(run.len(), ends),
        };
        let mut matrix = gram(&basis, &first);
        matrix.add(&penalty, axis.smoothing(*cells));
        let factors = Cow::Owned(matrix.factor(basis.support() - 1));
        Section { basis, nodes, first: Cow::Owned(first), last: &[], moved: 0, factors }
    }
}

impl Section<'_> {
    /// The coefficients of the splines fitted to heights at the nodes.
    fn fit<const W: usize>(&self, heights: &[[f64; W]]) -> Vec<[f64; W]> {
        let (coefficients, support) = (self.basis.len(), self.basis.support());
        // The weights beyond a narrow grid's support are 0, but what they are added to must exist.
        let mut sums = vec![[0.0; W]; coefficients.max(SUPPORT)];
        let (first, last) = heights.split_at(self.first.len());
        for (nodes, heights, moved) in [(&self.first[..], first, 0), (self.last, last, self.moved)]
        {
            let sums = &mut sums[..];
            match support {
                4 => simd::dispatch(Project::<4, W> { nodes, heights, moved, sums }),
                _ => simd::dispatch(Project::<SUPPORT, W> { nodes, heights, moved, sums }),
            }
        }
        sums.truncate(coefficients);
        self.factors.solve(&mut sums);
        sums
    }
}

/// `Σ_i v_i v_iᵀ` with `v_i` the weights at node `i`.
fn gram(basis: &Basis, nodes: &[Local]) -> Banded {
    let mut gram = Banded::zero(basis.len());
    for node in nodes {
        gram.add_outer(node.start, &node.weights[0][..basis.support()], 1.0);
    }
    gram
}

/// Matrix of `∫ s‴(t)² dt`, by Gauss's three points per interval: exact to degree 5.
fn penalty(basis: &Basis) -> Banded {
    const GAUSS: [(f64, f64); 3] = [
        (0.112_701_665_379_258_3, 5.0 / 18.0),
        (0.5, 8.0 / 18.0),
        (0.887_298_334_620_741_7, 5.0 / 18.0),
    ];
    let mut penalty = Banded::zero(basis.len());
    for k in 0..basis.intervals() {
        for (u, share) in GAUSS {
            let local = basis.at(basis.node(k, u));
            let weights = &local.weights[3][..basis.support()];
            penalty.add_outer(local.start, weights, share / basis.density());
        }
    }
    penalty
}

/// Adds the right-hand side of the normal equations to `sums`: `Σ_i v_i z_i`, of heights `z` with the first `N` weights `v` at their
/// nodes, whose coefficients come by `moved` sooner.
struct Project<'a, const N: usize, const W: usize> {
    nodes: &'a [Local],
    heights: &'a [[f64; W]],
    moved: usize,
    sums: &'a mut [[f64; W]],
}

impl<const N: usize, const W: usize> Kernel for Project<'_, N, W> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { nodes, heights, moved, sums } = self;
        for (node, z) in nodes.iter().zip(heights) {
            let start = node.start - moved;
            let sums = &mut sums[start..start + N];
            for (sum, weight) in sums.iter_mut().zip(&node.weights[0]) {
                for i in 0..W {
                    sum[i] += weight * z[i];
                }
            }
        }
    }
}

/// Coefficients of a tensor-product spline, row-major, and its two axes.
#[derive(Clone, Debug)]
pub(in crate::surface) struct Fit {
    pub(in crate::surface) x: Axis,
    pub(in crate::surface) y: Axis,
    pub(in crate::surface) coefficients: Vec<f64>,
    /// Where it has coefficients; they are 0 elsewhere.
    pub(in crate::surface) domain: Domain,
}

impl Fit {
    /// Fits the heights in a domain.
    pub(in crate::surface) fn new(
        frame: &GridFrame,
        heights: &Continued<'_>,
        plan: &FitPlan,
        domain: Domain,
        control: &Control,
    ) -> Result<Self> {
        let x = Axis::new(plan.degree, frame.cols(), plan.intervals[0]);
        let y = Axis::new(plan.degree, frame.rows(), plan.intervals[1]);
        let width = x.basis.len();
        control.report(STAGE, 0.0);
        let mut coefficients = vec![0.0; frame.rows() * width];
        solve_rows(frame, &x, plan.cutoff, heights, &domain, &mut coefficients, control)?;
        control.report(STAGE, 0.5);
        let cells = plan.cutoff / frame.mid_spacing().y;
        solve_columns(&y, cells, &domain, &mut coefficients, width, control)?;
        coefficients.truncate(width * y.basis.len());
        coefficients.shrink_to_fit();
        control.report(STAGE, 1.0);
        Ok(Self { x, y, coefficients, domain })
    }

    /// Values at the nodes in the columns `cols` of a row, into those places of `values`.
    pub(in crate::surface) fn row_values(
        &self,
        row: usize,
        cols: Range<usize>,
        values: &mut [f64],
    ) {
        let (width, support) = (self.x.basis.len(), self.x.basis.support());
        let node = &self.y.nodes[row];
        let [first, last] = [cols.start, cols.end - 1].map(|col| self.x.nodes[col].start);
        let mut line = vec![0.0; last + support - first];
        for (k, weight) in node.weights[0][..self.y.basis.support()].iter().enumerate() {
            let coefficients = &self.coefficients[(node.start + k) * width + first..];
            line.iter_mut().zip(coefficients).for_each(|(sum, c)| *sum += weight * c);
        }
        let value = |node: &Local| dot(&node.weights[0][..support], &line[node.start - first..]);
        let uniform = self.x.uniform.start.clamp(cols.start, cols.end)
            ..self.x.uniform.end.clamp(cols.start, cols.end);
        for col in (cols.start..uniform.start).chain(uniform.end..cols.end) {
            values[col] = value(&self.x.nodes[col]);
        }
        if uniform.is_empty() {
            return;
        }
        let node = &self.x.nodes[uniform.start];
        let windows = line[node.start - first..].windows(support);
        for (value, window) in values[uniform].iter_mut().zip(windows) {
            *value = dot(&node.weights[0][..support], window);
        }
    }

    /// Whether there are all coefficients that bear on a point.
    pub(in crate::surface) fn is_complete(&self, x: &Local, y: &Local) -> bool {
        let columns = x.start..x.start + self.x.basis.support();
        let rows = y.start..y.start + self.y.basis.support();
        self.domain.is_whole || self.domain.holds(&columns, rows)
    }

    /// `z` differentiated `orders[k]` times along columns and rows, per node, at grid coordinates `at`. Not a number where a
    /// coefficient is missing.
    pub(in crate::surface) fn derivatives<const K: usize>(
        &self,
        at: DVec2,
        orders: [[usize; 2]; K],
    ) -> [f64; K] {
        let (x, y) = (self.x.basis.at(at.x), self.y.basis.at(at.y));
        let support = self.x.basis.support();
        if !self.is_complete(&x, &y) {
            return [f64::NAN; K];
        }
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
/// [`LANES`] rows are solved together, if they have the same runs of knots. Where meridians converge their cells differ in
/// width; they share the cut-off in cells of the middle one if that changes none by more than [`SHARED_CUTOFF_TOLERANCE`].
fn solve_rows(
    frame: &GridFrame,
    axis: &Axis,
    cutoff: f64,
    heights: &Continued<'_>,
    domain: &Domain,
    coefficients: &mut [f64],
    control: &Control,
) -> Result<()> {
    let cells = |row: usize| if cutoff > 0.0 { cutoff / frame.spacing(row as f64).x } else { 0.0 };
    let top = axis.normal(cells(0));
    let normal = |cells_there: f64| match cells_there == cells(0) {
        true => Cow::Borrowed(&top),
        false => Cow::Owned(axis.normal(cells_there)),
    };
    let width = axis.basis.len();
    let groups = coefficients.par_chunks_mut(LANES * width);
    groups.enumerate().try_for_each(|(group, coefficients)| {
        control.check()?;
        let (first, count) = (group * LANES, coefficients.len() / width);
        let runs: Vec<_> = (first..first + count).map(|row| domain.runs_at(row)).collect();
        let shared = cells(first + count / 2);
        let spread = (cells(first) - shared).abs().max((cells(first + count - 1) - shared).abs());
        let one_cutoff = spread <= SHARED_CUTOFF_TOLERANCE * shared;
        let of_group = one_cutoff.then(|| normal(shared));
        let one_domain = runs.iter().all(|of_row| *of_row == runs[0]);
        match &of_group {
            Some(normal) if one_domain => {
                solve_lines::<LANES>(normal, first, &runs[0], heights, coefficients);
            }
            _ => {
                let rows = coefficients.chunks_mut(width).zip(runs);
                for (row, (coefficients, runs)) in (first..).zip(rows) {
                    match &of_group {
                        Some(normal) => solve_lines::<1>(normal, row, &runs, heights, coefficients),
                        None => {
                            solve_lines::<1>(&normal(cells(row)), row, &runs, heights, coefficients)
                        }
                    }
                }
            }
        }
        Ok(())
    })
}

/// Fits at most `W` rows from `first` on side by side, on runs of knots that they share: as many rows of `coefficients`.
fn solve_lines<const W: usize>(
    normal: &Normal<'_>,
    first: usize,
    runs: &[Range<usize>],
    heights: &Continued<'_>,
    coefficients: &mut [f64],
) {
    let width = normal.axis.basis.len();
    let count = coefficients.len() / width;
    let mut rows: Vec<_> = (first..first + count).map(|row| heights.row(row)).collect();
    for run in runs {
        let section = normal.section(run);
        let mut lanes = vec![[0.0; W]; section.nodes.len()];
        for (i, row) in rows.iter_mut().enumerate() {
            let heights = row.heights(section.nodes.clone());
            lanes.iter_mut().zip(heights).for_each(|(lanes, z)| lanes[i] = z);
        }
        let x = section.fit(&lanes);
        for (i, row) in coefficients.chunks_mut(width).enumerate() {
            let row = &mut row[run.clone()];
            row.iter_mut().zip(&x).for_each(|(coefficient, lanes)| *coefficient = lanes[i]);
        }
    }
}

/// Fits every column; its coefficients take the place of its first values.
fn solve_columns(
    axis: &Axis,
    cells: f64,
    domain: &Domain,
    values: &mut [f64],
    width: usize,
    control: &Control,
) -> Result<()> {
    let normal = axis.normal(cells);
    let stripes = stripes(values, width).into_par_iter().zip(domain.columns.par_chunks(LANES));
    stripes.try_for_each(|(mut stripe, runs)| {
        control.check()?;
        if runs.iter().all(|of_column| *of_column == runs[0]) {
            solve_stripe::<LANES>(&normal, &mut stripe, 0..runs.len(), &runs[0]);
        } else {
            for (column, runs) in runs.iter().enumerate() {
                solve_stripe::<1>(&normal, &mut stripe, column..column + 1, runs);
            }
        }
        Ok(())
    })
}

/// Fits at most `W` columns of a stripe side by side, on runs of knots that they share.
fn solve_stripe<const W: usize>(
    normal: &Normal<'_>,
    stripe: &mut [&mut [f64]],
    columns: Range<usize>,
    runs: &[Range<usize>],
) {
    for run in runs {
        let section = normal.section(run);
        let mut lanes = vec![[0.0; W]; section.nodes.len()];
        for (lanes, piece) in lanes.iter_mut().zip(&stripe[section.nodes.clone()]) {
            lanes[..columns.len()].copy_from_slice(&piece[columns.clone()]);
        }
        let x = section.fit(&lanes);
        for (piece, lanes) in stripe[run.clone()].iter_mut().zip(&x) {
            piece[columns.clone()].copy_from_slice(&lanes[..columns.len()]);
        }
    }
}

/// Stripes of [`LANES`] columns as lists of row pieces, so that threads can write them without overlap.
fn stripes(values: &mut [f64], width: usize) -> Vec<Vec<&mut [f64]>> {
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
