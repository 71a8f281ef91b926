//! The difference curvature tensor DC of the paper, equations (5) and (6): how the curvature tensor changes over the
//! surface.
//!
//! CT is taken as a tensor in space, `C = Σ s_i v_i v_iᵀ = J D Jᵀ`, `s_i = 1/(δ+|κ_i|)` in m, so that neighbours can be
//! compared. In an orthonormal frame of the tangent plane its changes make a symmetric matrix `Γ` with eigenpairs
//! `γ_i, q_i`, and
//!
//! ```text
//!   D = Σ_i 1/(δ+γ_i) q_i q_iᵀ = E (δ + Γ)⁻¹ Eᵀ ,      E the frame in grid coordinates, EᵀGE = 1.
//! ```
//!
//! | [`DifferenceForm`] | `Γ` | unit of `γ` and `δ` |
//! |---|---|---|
//! | `Rate` | `Γ_ij = ⟨∇_i C, ∇_j C⟩` along the frame | 1 |
//! | `Literal` | `TᵀT = Σ_j ((l_j^+)² + (l_j^-)²) e_j e_jᵀ`, `e_j` the unit tangent along `S_j`, `l_j^± = ‖C(x) − C(u_j^±)‖` | m² |
//!
//! `‖·‖` and `⟨·,·⟩` are Frobenius's. `∇` is the covariant derivative, the tangential part of that in space: where the shape is the
//! same everywhere, on a plane, a cylinder, a sphere, it is 0. The differences in space also see `C` turn with the surface, by
//! `√2 sκ` per length.

use std::mem;
use std::sync::atomic::{AtomicUsize, Ordering};

use glam::{DMat3, DQuat, DVec2, DVec3};
use rayon::prelude::*;

use super::nodes::{NodeTensors, Nodes};
use super::{Delta, Metric, MetricOptions, NamedMetric, Norm, Unit, curvature};
use crate::control::Control;
use crate::error::Result;
use crate::linalg::Sym2;
use crate::surface::{Surface, SurfaceJet};

pub(super) const RATE: NamedMetric = NamedMetric {
    name: "difference",
    about: "The rate at which the curvature tensor changes, in AG units",
    make: |options: &MetricOptions| Ok(Box::new(with(DifferenceForm::Rate, options))),
};

pub(super) const LITERAL: NamedMetric = NamedMetric {
    name: "difference-literal",
    about: "The same from cell to cell, as the paper prints it: depends on the cell size and the grid's directions",
    make: |options: &MetricOptions| Ok(Box::new(with(DifferenceForm::Literal, options))),
};

/// The metric of a form with options.
fn with(form: DifferenceForm, options: &MetricOptions) -> Difference {
    let default = Difference::default();
    Difference {
        form,
        curvature_delta: options.delta.unwrap_or(default.curvature_delta),
        delta: options.difference_delta.unwrap_or(default.delta),
    }
}

/// The difference curvature tensor DC, `D = Σ 1/(δ+γ_i) q_i q_iᵀ`, from how CT changes. Computed at the nodes when the metric is
/// bound; between them `D` is bilinear.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Difference {
    /// What is taken for the change of the curvature tensor.
    pub form: DifferenceForm,
    /// `δ` of the curvature tensor that is compared. Default: all of the root-mean-square curvature. With a tenth of it, as
    /// routes on the curvature tensor have, `1/(δ+|κ|)` changes most by far where there is next to no curvature, and
    /// plains become the costliest ground (`docs/mathematics.md` has a measurement).
    pub curvature_delta: Delta,
    /// `δ` beside `γ`. [`Delta::Auto`] is a share of the square of the mean of `√(γ1+γ2)` over the surface, but at least 1e-6
    /// (times the mean area of a cell, if literal): rates `√γ` below 1e-3 are rounding.
    /// [`Delta::Absolute`] is in the unit of `γ`. Default: all of it. With less, speeds differ so much with the direction that
    /// the grid no longer resolves them.
    pub delta: Delta,
}

impl Default for Difference {
    fn default() -> Self {
        Self {
            form: DifferenceForm::default(),
            curvature_delta: Delta::Auto(1.0),
            delta: Delta::Auto(1.0),
        }
    }
}

/// What is taken for the change of the curvature tensor.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum DifferenceForm {
    /// The rate of change `‖∇_v C‖²` along each direction `v` of the surface. It converges with the grid, to what depends on
    /// the surface only. `γ` has no unit, so a uniform scale multiplies distances by a constant, those of an absolute
    /// [`Difference::delta`] too.
    #[default]
    Rate,
    /// The differences to the four neighbours as the paper prints them. They shrink with the cells, and see only what changes
    /// along grid lines. Where a neighbour is missing the one across counts twice.
    Literal,
}

/// How the curvature tensor changes around a node, see [`Difference::changes`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Change {
    /// `Γ` in the orthonormal tangent frame whose first vector lies along `S_1`; its eigenvalues are `γ1, γ2`. Not finite
    /// where the surface is degenerate.
    pub gamma: Sym2,
    /// Area of the surface that belongs to the node, `√det G`, m².
    pub area: f64,
}

impl Difference {
    /// How the curvature tensor changes around every node, row-major. Takes 220 ns of one core per node, together with what
    /// [`norm`](Metric::norm) makes of it, and 32 bytes per node.
    ///
    /// # Errors
    /// [`Error::Argument`](crate::Error::Argument) for a `δ` of the curvature tensor that is not positive and finite;
    /// [`Error::Cancelled`](crate::Error::Cancelled).
    pub fn changes(&self, surface: &dyn Surface, control: &Control) -> Result<Vec<Change>> {
        self.changes_with_delta(self.curvature_delta.on(surface)?, surface, control)
    }

    /// The same where the curvature tensor has the given `δ`.
    fn changes_with_delta(
        &self,
        curvature_delta: f64,
        surface: &dyn Surface,
        control: &Control,
    ) -> Result<Vec<Change>> {
        at_nodes(surface, curvature_delta, control, |around| {
            let gamma = match self.form {
                DifferenceForm::Rate => around.rates(),
                DifferenceForm::Literal => around.literal(),
            };
            Change { gamma, area: around.here.form.det().sqrt() }
        })
    }
}

impl Metric for Difference {
    fn name(&self) -> &str {
        match self.form {
            DifferenceForm::Rate => RATE.name,
            DifferenceForm::Literal => LITERAL.name,
        }
    }

    fn unit(&self) -> Unit {
        Unit::Ag
    }

    /// `D` is not finite where the surface is degenerate; voids have the tensor of the continued surface.
    fn norm(&self, surface: &dyn Surface, control: &Control) -> Result<Norm> {
        // Checked before the work.
        let number = self.delta.number()?;
        let curvature_delta = self.curvature_delta.on(surface)?;
        let changes = self.changes_with_delta(curvature_delta, surface, control)?;
        let delta = match self.delta {
            Delta::Absolute(_) => number,
            Delta::Auto(_) => offset(surface, self.form, &changes, number),
        };
        let tensors = tensors(surface, &changes, delta, control)?;
        let products: Vec<f64> = changes.par_iter().map(|change| change.gamma.det()).collect();
        let unit = match self.form {
            DifferenceForm::Rate => "",
            DifferenceForm::Literal => "m²",
        };
        Ok(Norm::quadratic(NodeTensors { nodes: Nodes::of(surface), tensors })
            .with_parameter("delta_per_m", curvature_delta, "1/m")
            .with_parameter("difference_delta", delta, unit)
            .with_level(delta)
            .with_seed_ranks(products))
    }
}

/// `D` at the nodes in the axes of the surface.
fn tensors(
    surface: &dyn Surface,
    changes: &[Change],
    delta: f64,
    control: &Control,
) -> Result<Vec<Sym2>> {
    let mut tensors = vec![Sym2::default(); changes.len()];
    let cols = surface.cols().max(1);
    let rows = changes.par_chunks(cols).zip(tensors.par_chunks_mut(cols)).enumerate();
    rows.for_each(|(row, (changes, tensors))| {
        if control.cancel.is_cancelled() {
            return;
        }
        let (jets, axes) = (surface.row_space_jets(row), surface.axes(row as f64));
        for ((change, jet), tensor) in changes.iter().zip(&jets).zip(tensors) {
            let inverse = (change.gamma + Sym2::new(delta, 0.0, delta)).inverse();
            *tensor = Frame::of(jet.first_form()).to_grid(inverse).rescale(axes);
        }
    });
    control.check()?;
    Ok(tensors)
}

/// The automatic `δ`, see [`Difference::delta`]. It goes by the mean of `√(γ1+γ2)` over the area that is there and not of its square, since
/// only the mean has a limit where the curvature jumps.
fn offset(surface: &dyn Surface, form: DifferenceForm, changes: &[Change], share: f64) -> f64 {
    let rows: Vec<_> = changes
        .par_chunks(surface.cols().max(1))
        .enumerate()
        .map(|(row, changes)| sums_of_row(surface, row, changes))
        .collect();
    // Added row by row, so that the sum does not depend on the number of threads.
    let [sum, area, count] =
        rows.iter().fold([0.0; 3], |sum, row| [0, 1, 2].map(|k| sum[k] + row[k]));
    if area == 0.0 {
        return 1.0;
    }
    let unit = match form {
        DifferenceForm::Rate => 1.0,
        DifferenceForm::Literal => area / count,
    };
    (share * (sum / area).powi(2)).max(1e-6 * unit)
}

/// `∫ √(γ1+γ2)`, area and number of the nodes of a row that are there.
fn sums_of_row(surface: &dyn Surface, row: usize, changes: &[Change]) -> [f64; 3] {
    let there = changes.iter().enumerate().filter(|(col, _)| !surface.is_void(*col, row));
    there.fold([0.0; 3], |[sum, area, count], (_, change)| {
        let rate = (change.gamma.xx + change.gamma.yy).sqrt() * change.area;
        if rate.is_finite() {
            [sum + rate, area + change.area, count + 1.0]
        } else {
            [sum, area, count]
        }
    })
}

/// An orthonormal frame `e_1, e_2` of the tangent plane in grid coordinates, `e_1` along `S_1`: with `G = LLᵀ`, `L = [a 0; b c]`,
/// its vectors are the columns of `L⁻ᵀ`.
struct Frame {
    a: f64,
    b: f64,
    c: f64,
}

impl Frame {
    fn of(form: Sym2) -> Self {
        let a = form.xx.sqrt();
        Self { a, b: form.xy / a, c: (form.det() / form.xx).sqrt() }
    }

    fn vectors(&self) -> [DVec2; 2] {
        let Self { a, b, c } = self;
        [DVec2::new(1.0 / a, 0.0), DVec2::new(-b / (a * c), 1.0 / c)]
    }

    /// A contravariant tensor of the frame in grid coordinates.
    fn to_grid(&self, d: Sym2) -> Sym2 {
        let [e1, e2] = self.vectors();
        let mixed = Sym2::outer(e1 + e2) + (Sym2::outer(e1) + Sym2::outer(e2)) * -1.0;
        Sym2::outer(e1) * d.xx + mixed * d.xy + Sym2::outer(e2) * d.yy
    }
}

/// A node: `S_1` and `S_2` there, and CT in space.
#[derive(Debug)]
struct Node {
    first: [DVec3; 2],
    form: Sym2,
    tensor: DMat3,
    /// Whether neighbours are compared with it.
    counts: bool,
}

impl Node {
    fn new(jet: &SurfaceJet, delta: f64, void: bool) -> Self {
        let [s1, s2] = jet.first;
        let d = curvature::in_space(jet, delta);
        let (a, b) = (s1 * d.xx + s2 * d.xy, s1 * d.xy + s2 * d.yy);
        let columns = [0, 1, 2].map(|k| a * s1[k] + b * s2[k]);
        let tensor = DMat3::from_cols(columns[0], columns[1], columns[2]);
        // Without a tangent plane there is neither a tensor nor a direction to look along.
        let regular = jet.is_regular();
        let form = if regular { jet.first_form() } else { Sym2::new(f64::NAN, f64::NAN, f64::NAN) };
        let counts = regular && !void && tensor.is_finite();
        Self { first: jet.first, form, tensor, counts }
    }

    /// Unit normal.
    fn normal(&self) -> DVec3 {
        self.first[1].cross(self.first[0]).normalize()
    }

    /// CT transported to a neighbour, along with the tangent plane.
    fn transported_to(&self, other: &Self) -> DMat3 {
        let rotation = DMat3::from_quat(DQuat::from_rotation_arc(self.normal(), other.normal()));
        rotation * self.tensor * rotation.transpose()
    }
}

/// A node and its neighbours `u_1^+, u_1^-, u_2^+, u_2^-`, as far as they are there.
struct Neighbourhood<'a> {
    here: &'a Node,
    neighbours: [Option<&'a Node>; 4],
}

impl Neighbourhood<'_> {
    /// `l` to neighbour `k`, m; NaN if there is none.
    fn difference(&self, k: usize) -> f64 {
        self.neighbours[k].map_or(f64::NAN, |there| norm(there.tensor - self.here.tensor))
    }

    /// A derivative in space whose tangential part is `∇C` along `u_j`: central, one-sided where a neighbour is missing, 0 where both
    /// are. A chord to one side has a part of first order in the tangent plane only because that turns, so the neighbour's tensor is
    /// transported back.
    fn derivative(&self, j: usize) -> DMat3 {
        let here = self.here;
        match (self.neighbours[2 * j], self.neighbours[2 * j + 1]) {
            (Some(after), Some(before)) => (after.tensor - before.tensor) * 0.5,
            (Some(after), None) => after.transported_to(here) - here.tensor,
            (None, Some(before)) => here.tensor - before.transported_to(here),
            (None, None) => DMat3::ZERO,
        }
    }

    /// `Γ` of [`DifferenceForm::Rate`].
    fn rates(&self) -> Sym2 {
        let [s1, s2] = self.here.first;
        let [e1, e2] = Frame::of(self.here.form).vectors();
        let (t1, t2) = (s1 * e1.x, s1 * e2.x + s2 * e2.y);
        let tangential = |m: DMat3| Sym2::new(t1.dot(m * t1), t1.dot(m * t2), t2.dot(m * t2));
        let (d1, d2) = (tangential(self.derivative(0)), tangential(self.derivative(1)));
        let (along1, along2) = (d1 * e1.x, d1 * e2.x + d2 * e2.y);
        let dot = |a: Sym2, b: Sym2| a.xx * b.xx + 2.0 * a.xy * b.xy + a.yy * b.yy;
        Sym2::new(dot(along1, along1), dot(along1, along2), dot(along2, along2))
    }

    /// `Γ` of [`DifferenceForm::Literal`].
    fn literal(&self) -> Sym2 {
        let Frame { b, c, .. } = Frame::of(self.here.form);
        let tangents = [DVec2::X, DVec2::new(b, c).normalize()];
        let doubled_mean = |j: usize| {
            let squares = [2 * j, 2 * j + 1].map(|k| self.difference(k).powi(2));
            let known = squares.iter().filter(|square| !square.is_nan());
            2.0 * known.clone().sum::<f64>() / known.count().max(1) as f64
        };
        Sym2::outer(tangents[0]) * doubled_mean(0) + Sym2::outer(tangents[1]) * doubled_mean(1)
    }
}

/// Frobenius norm.
fn norm(a: DMat3) -> f64 {
    (a.x_axis.length_squared() + a.y_axis.length_squared() + a.z_axis.length_squared()).sqrt()
}

/// Name of the stage in progress reports.
const STAGE: &str = "comparing curvature";

/// Rows that one thread takes in turn: two more are evaluated for each band.
const BAND: usize = 32;

/// `value` at every node, row-major. Three rows of nodes are held at a time.
fn at_nodes<T: Clone + Default + Send>(
    surface: &dyn Surface,
    delta: f64,
    control: &Control,
    value: impl Fn(&Neighbourhood<'_>) -> T + Sync,
) -> Result<Vec<T>> {
    let (cols, rows) = (surface.cols(), surface.rows());
    let [across, down] = surface.periodic();
    let load = |row: usize| -> Vec<Node> {
        let jets = surface.row_space_jets(row);
        let node = |(col, jet)| Node::new(jet, delta, surface.is_void(col, row));
        jets.iter().enumerate().map(node).collect()
    };
    let mut values = vec![T::default(); cols * rows];
    let (bands, done) = (rows.div_ceil(BAND), AtomicUsize::new(0));
    values.par_chunks_mut(cols.max(1) * BAND).enumerate().for_each(|(band, values)| {
        let first = band * BAND;
        let mut before = neighbours(first, rows, down)[1].map(load);
        let mut here = load(first);
        for (row, values) in (first..).zip(values.chunks_mut(cols)) {
            if control.cancel.is_cancelled() {
                return;
            }
            let after = neighbours(row, rows, down)[0].map(load);
            for (col, out) in values.iter_mut().enumerate() {
                let [east, west] = neighbours(col, cols, across).map(|col| Some(&here[col?]));
                let [south, north] = [&after, &before].map(|row| row.as_ref().map(|row| &row[col]));
                let neighbours = [east, west, south, north];
                let neighbours = neighbours.map(|node| node.filter(|node| node.counts));
                *out = value(&Neighbourhood { here: &here[col], neighbours });
            }
            before = Some(mem::replace(&mut here, after.unwrap_or_default()));
        }
        let done = done.fetch_add(1, Ordering::Relaxed);
        control.report(STAGE, done as f64 / bands as f64);
    });
    control.check()?;
    control.report(STAGE, 1.0);
    Ok(values)
}

/// The indices after and before `i` among `count`.
fn neighbours(i: usize, count: usize, periodic: bool) -> [Option<usize>; 2] {
    let after = if i + 1 < count { Some(i + 1) } else { periodic.then_some(0) };
    let before = if i > 0 { Some(i - 1) } else { periodic.then_some(count - 1) };
    [after, before]
}

#[cfg(test)]
mod tests {
    use std::f64::consts::{FRAC_PI_2, PI, SQRT_2};

    use glam::DVec3;

    use super::DifferenceForm::{Literal, Rate};
    use super::*;
    use std::sync::Arc;

    use crate::control::CancelToken;
    use crate::error::Error;
    use crate::grid::{GridFrame, Ground};
    use crate::metric::{Isotropic, Modifiers};
    use crate::surface::{FitOptions, HeightSurface, Jet, Smoothing};
    use crate::terrain::{Crs, Terrain};

    /// The surface of a formula, whose parameters are `origin` at node (0, 0) and change by `steps` per column and per row.
    struct Formula<F: Fn(DVec2) -> SurfaceJet + Sync> {
        counts: [usize; 2],
        origin: DVec2,
        steps: [DVec2; 2],
        periodic: [bool; 2],
        voids: fn(usize, usize) -> bool,
        jet: F,
    }

    impl<F: Fn(DVec2) -> SurfaceJet + Sync> Surface for Formula<F> {
        fn cols(&self) -> usize {
            self.counts[0]
        }

        fn rows(&self) -> usize {
            self.counts[1]
        }

        fn periodic(&self) -> [bool; 2] {
            self.periodic
        }

        fn is_void(&self, col: usize, row: usize) -> bool {
            (self.voids)(col, row)
        }

        fn jet(&self, at: DVec2) -> Jet {
            let [a, b] = self.steps;
            let SurfaceJet { point, first: [s1, s2], second: [s11, s12, s22] } =
                (self.jet)(self.origin + a * at.x + b * at.y);
            let second = |v: DVec2, w: DVec2| {
                s11 * (v.x * w.x) + s12 * (v.x * w.y + v.y * w.x) + s22 * (v.y * w.y)
            };
            Jet::Space(SurfaceJet {
                point,
                first: [s1 * a.x + s2 * a.y, s1 * b.x + s2 * b.y],
                second: [second(a, a), second(a, b), second(b, b)],
            })
        }
    }

    /// A formula over the unit square.
    fn square<F: Fn(DVec2) -> SurfaceJet + Sync>(side: usize, jet: F) -> Formula<F> {
        let step = 1.0 / (side - 1) as f64;
        Formula {
            counts: [side; 2],
            origin: DVec2::ZERO,
            steps: [DVec2::X * step, DVec2::Y * step],
            periodic: [false; 2],
            voids: |_, _| false,
            jet,
        }
    }

    fn changes_of(surface: &dyn Surface, form: DifferenceForm) -> Vec<Change> {
        let curvature_delta = Delta::Absolute(0.25);
        let difference = Difference { form, curvature_delta, ..Difference::default() };
        difference.changes(surface, &Control::default()).unwrap()
    }

    fn error(a: Sym2, b: Sym2) -> f64 {
        let e = a + b * -1.0;
        e.xx.abs().max(e.xy.abs()).max(e.yy.abs())
    }

    /// A plane.
    fn plane(at: DVec2) -> SurfaceJet {
        SurfaceJet {
            point: DVec3::new(at.x, at.y, 2.0 * at.x),
            first: [DVec3::new(1.0, 0.0, 2.0), DVec3::Y],
            second: [DVec3::ZERO; 3],
        }
    }

    /// A cylinder of radius 2 over `x` in quarters of a turn.
    fn cylinder(at: DVec2) -> SurfaceJet {
        let (sin, cos) = (FRAC_PI_2 * at.x).sin_cos();
        let outward = DVec3::new(sin, 0.0, cos) * 2.0;
        SurfaceJet {
            point: outward + DVec3::Y * at.y,
            first: [DVec3::new(cos, 0.0, -sin) * PI, DVec3::Y],
            second: [outward * -FRAC_PI_2.powi(2), DVec3::ZERO, DVec3::ZERO],
        }
    }

    /// The graph of `f(x, y)`, given with its derivatives `x, y, xx, xy, yy`.
    fn graph(at: DVec2, [f, x, y, xx, xy, yy]: [f64; 6]) -> SurfaceJet {
        SurfaceJet {
            point: at.extend(f),
            first: [DVec3::new(1.0, 0.0, x), DVec3::new(0.0, 1.0, y)],
            second: [xx, xy, yy].map(|second| DVec3::Z * second),
        }
    }

    /// `z = x²/2`, whose curvature is `(1 + x²)^(−3/2)`.
    fn parabola(at: DVec2) -> SurfaceJet {
        graph(at, [0.5 * at.x * at.x, at.x, 0.0, 1.0, 0.0, 0.0])
    }

    /// Hills without any symmetry, not flat anywhere near the origin.
    fn hills(at: DVec2) -> SurfaceJet {
        let (x, y) = (at.x, at.y);
        let (sin, cos) = (x + 0.3 * y).sin_cos();
        graph(
            at,
            [cos + 0.3 * y * y, -sin, -0.3 * sin + 0.6 * y, -cos, -0.3 * cos, -0.09 * cos + 0.6],
        )
    }

    #[test]
    fn planes_cylinders_and_spheres_do_not_change() {
        let sphere = |at: DVec2| {
            let (x, y) = (at.x, at.y);
            let z = (4.0 - x * x - y * y).sqrt();
            let second = |v: f64, w: f64, same: f64| -same / z - v * w / z.powi(3);
            graph(at, [z, -x / z, -y / z, second(x, x, 1.0), second(x, y, 0.0), second(y, y, 1.0)])
        };
        let still = |surface: &dyn Surface| {
            let changes = changes_of(surface, Rate);
            changes.iter().map(|change| change.gamma.xx + change.gamma.yy).fold(0.0, f64::max)
        };
        let largest =
            [still(&square(9, plane)), still(&square(33, cylinder)), still(&square(33, sphere))];
        assert!(largest.iter().all(|&gamma| gamma < 1e-6), "{largest:?}");
        // In space they turn. κ = 1/2, δ = 1/4
        let side = 201;
        let square_rate = (SQRT_2 * 0.5 / 0.75 * PI / (side - 1) as f64).powi(2);
        for change in changes_of(&square(side, cylinder), Literal) {
            assert!(
                error(change.gamma, Sym2::new(2.0 * square_rate, 0.0, 0.0)) < 1e-3 * square_rate
            );
        }
    }

    #[test]
    fn growing_curvature_is_differentiated_with_second_order() {
        // C = s ttᵀ + yyᵀ/δ: ‖∇C‖ along the arc length a is |ds/da|.
        let exact = |x: f64| {
            let w = 1.0 + x * x;
            let (kappa, slope) = (w.powf(-1.5), -3.0 * x * w.powf(-2.5) / w.sqrt());
            let s = 1.0 / (0.25 + kappa);
            Sym2::new((s * s * slope).powi(2), 0.0, 0.0)
        };
        let largest = |side: usize| {
            let changes = changes_of(&square(side, parabola), Rate);
            let inner = (1..side - 1).map(|col| {
                let x = col as f64 / (side - 1) as f64;
                error(changes[5 * side + col].gamma, exact(x))
            });
            inner.fold(0.0, f64::max)
        };
        let [coarse, fine] = [51, 101].map(largest);
        assert!(fine < 1e-3 && (coarse / fine).log2() > 1.9, "{coarse:e} {fine:e}");
    }

    #[test]
    fn the_rate_does_not_depend_on_how_the_grid_is_laid_but_the_literal_form_does() {
        let at = DVec2::new(0.4, 0.3);
        let invariants = |form: DifferenceForm, steps: [DVec2; 2]| {
            let surface =
                Formula { origin: at - 2.0 * steps[0] - 2.0 * steps[1], steps, ..square(5, hills) };
            let gamma = changes_of(&surface, form)[2 * 5 + 2].gamma;
            [gamma.xx + gamma.yy, gamma.det()]
        };
        let h = 1e-3;
        let straight = [DVec2::X * h, DVec2::Y * h];
        let oblique = [DVec2::new(1.0, 0.9) * h, DVec2::new(-0.5, 2.0) * h];
        for (a, b) in invariants(Rate, straight).into_iter().zip(invariants(Rate, oblique)) {
            assert!((a - b).abs() < 1e-4 * a.abs(), "{a} {b}");
        }
        // On the diagonal of a trough the paper's form no longer sees that nothing changes along it.
        let diagonal = [DVec2::new(h, h), DVec2::new(h, -h)];
        let trough = |form, steps| {
            let surface = Formula { origin: at, steps, ..square(5, parabola) };
            let gamma = changes_of(&surface, form)[2 * 5 + 2].gamma;
            gamma.det() / (gamma.xx + gamma.yy).powi(2)
        };
        assert!(trough(Rate, diagonal) < 1e-6 && trough(Literal, straight) < 1e-12);
        assert!(trough(Literal, diagonal) > 0.01);
    }

    #[test]
    fn differences_to_the_neighbours_are_chords_of_the_tensor() {
        let side = 41;
        let ring = Formula {
            counts: [side, 7],
            steps: [DVec2::X * 4.0 / side as f64, DVec2::Y * 0.1],
            periodic: [true, false],
            ..square(side, cylinder)
        };
        let control = Control::default();
        let differences =
            at_nodes(&ring, 0.25, &control, |around| [0, 1, 2, 3].map(|k| around.difference(k)));
        // ttᵀ, turned by the angle θ, is √2 sin θ away.
        let angle = 2.0 * PI / side as f64;
        let chord = SQRT_2 * angle.sin() / 0.75;
        for (l, row) in differences.unwrap().iter().zip((0..).map(|i| i / side)) {
            assert!((l[0] - chord).abs() < 1e-12 && (l[1] - chord).abs() < 1e-12, "{l:?}");
            assert!(if row < 6 { l[2] < 1e-12 } else { l[2].is_nan() });
            assert!(if row > 0 { l[3] < 1e-12 } else { l[3].is_nan() });
        }
    }

    #[test]
    fn missing_neighbours_are_left_out() {
        let voids = |col: usize, row: usize| (10..=20).contains(&col) && (10..=20).contains(&row);
        let side = 31;
        for form in [Rate, Literal] {
            let whole = changes_of(&square(side, hills), form);
            let holed = changes_of(&Formula { voids, ..square(side, hills) }, form);
            let most = whole.iter().map(|c| c.gamma.xx + c.gamma.yy).fold(0.0, f64::max);
            for (i, (a, b)) in whole.iter().zip(&holed).enumerate() {
                let (col, row) = (i % side, i / side);
                let e = error(a.gamma, b.gamma);
                assert!(voids(col, row) || e < 0.1 * most, "{form:?} {col} {row}: {e} {most}");
            }
            // No faster at the border than beside it.
            for col in 1..side - 1 {
                let e = error(whole[col].gamma, whole[side + col].gamma);
                assert!(e < 0.1 * most, "{form:?} {col}: {e} {most}");
            }
        }
        let island = Formula { voids: |col, row| col + row != 3, ..square(5, hills) };
        for change in changes_of(&island, Rate).iter().skip(3).step_by(4) {
            assert!(change.gamma.xx.is_finite() && change.area > 0.0);
        }
    }

    #[test]
    fn threads_change_no_bit() {
        let tensors = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let field = |surface: &dyn Surface| {
                let metric = Difference::default()
                    .on(surface, &Modifiers::default(), &Control::default())
                    .unwrap();
                let at = |i: usize| metric.speed(DVec2::new((i % 77) as f64, (i / 77) as f64));
                (0..77 * 77).map(|i| at(i).unwrap()).collect::<Vec<_>>()
            };
            pool.install(|| field(&square(77, hills)))
        };
        let one = tensors(1);
        assert!([2, 5].into_iter().all(|threads| tensors(threads) == one));
    }

    fn fitted(scale: f64, z: impl Fn(f64, f64) -> f64) -> HeightSurface {
        let step = DVec2::splat(30.0 * scale);
        let frame = GridFrame::new(41, 31, DVec2::ZERO, step, Ground::METRES).unwrap();
        let node = |i: usize| ((i % 41) as f64, (i / 41) as f64);
        let heights = (0..41 * 31).map(|i| scale * z(node(i).0, node(i).1)).collect();
        let terrain = Terrain::new(frame, heights, Crs::none()).unwrap();
        let options = FitOptions { smoothing: Smoothing::Interpolate, ..FitOptions::default() };
        HeightSurface::fit(&terrain, &options, &Control::default()).unwrap()
    }

    #[test]
    fn a_uniform_scale_scales_the_tensor() {
        let speeds = |form: DifferenceForm, scale: f64| -> Vec<Sym2> {
            let surface =
                fitted(scale, |x, y| 90.0 * (0.3 * x).sin() + 60.0 * (0.2 * y + 0.1 * x).cos());
            let metric = Difference { form, ..Difference::default() };
            let field = metric.on(&surface, &Modifiers::default(), &Control::default()).unwrap();
            assert!(
                field.parameter("difference_delta").unwrap() > 0.0
                    && field.parameter("delta_per_m").unwrap() > 0.0
            );
            (0..41)
                .map(|i| field.speed(DVec2::new(f64::from(i), 0.7 * f64::from(i))).unwrap())
                .collect()
        };
        for (form, power) in [(Rate, 0), (Literal, -2)] {
            for (a, b) in speeds(form, 1.0).into_iter().zip(speeds(form, 7.0)) {
                let wanted = a * 7f64.powi(power);
                assert!(error(b, wanted) < 1e-6 * (wanted.xx + wanted.yy), "{form:?}");
            }
        }
    }

    #[test]
    fn on_a_plane_the_metric_is_isotropic() {
        let surface = fitted(1.0, |x, y| 3.0 * x - 7.0 * y + 500.0);
        for form in [Rate, Literal] {
            let metric = Difference { form, ..Difference::default() };
            let field = metric.on(&surface, &Modifiers::default(), &Control::default()).unwrap();
            let geodesic =
                Isotropic.on(&surface, &Modifiers::default(), &Control::default()).unwrap();
            let at = DVec2::new(3.4, 17.0);
            let delta = field.parameter("difference_delta").unwrap();
            assert!(
                error(field.speed(at).unwrap() * delta, geodesic.speed(at).unwrap()) < 1e-6,
                "{form:?}"
            );
        }
    }

    #[test]
    fn binding_can_be_cancelled() {
        let cancelled = |control: &Control| {
            let (metric, surface) = (Difference::default(), square(150, hills));
            let in_space = metric.on(&surface, &Modifiers::default(), control);
            assert!(matches!(in_space, Err(Error::Cancelled)));
            let surface = fitted(1.0, |x, y| x * y);
            let on_ground = metric.on(&surface, &Modifiers::default(), control);
            assert!(matches!(on_ground, Err(Error::Cancelled)));
        };
        let control = Control::default();
        control.cancel.cancel();
        cancelled(&control);
        // In the middle.
        let cancel = CancelToken::default();
        let asked = cancel.clone();
        let progress = move |_: &str, done: f64| {
            assert!((0.0..1.0).contains(&done));
            asked.cancel();
        };
        cancelled(&Control { cancel, progress: Some(Arc::new(progress)) });
    }

    #[test]
    fn offsets_out_of_range_are_refused() {
        let surface = fitted(1.0, |x, _| x * x);
        let none = Modifiers::default();
        for bad in [Delta::Auto(0.0), Delta::Absolute(f64::NAN), Delta::Absolute(-1.0)] {
            let default = Difference::default();
            let own = Difference { delta: bad, ..default };
            let inner = Difference { curvature_delta: bad, ..default };
            assert!(
                own.on(&surface, &none, &Control::default()).is_err()
                    && inner.on(&surface, &none, &Control::default()).is_err()
            );
        }
    }
}
