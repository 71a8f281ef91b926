//! How the curvature tensor differs between a node and its neighbours.

use std::mem;
use std::sync::atomic::{AtomicUsize, Ordering};

use glam::{DMat3, DQuat, DVec2, DVec3};
use rayon::prelude::*;

use super::frame::Frame;
use crate::control::Control;
use crate::error::Result;
use crate::linalg::Sym2;
use crate::metric::curvature;
use crate::surface::{Surface, SurfaceJet};

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
pub(super) struct Neighbourhood<'a> {
    here: &'a Node,
    neighbours: [Option<&'a Node>; 4],
}

impl Neighbourhood<'_> {
    /// `l` to neighbour `k`, m; NaN if there is none.
    pub(super) fn difference(&self, k: usize) -> f64 {
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

    /// `√det G`, m².
    pub(super) fn area(&self) -> f64 {
        self.here.form.det().sqrt()
    }

    /// `Γ` of [`DifferenceForm::Rate`](super::DifferenceForm::Rate).
    pub(super) fn rates(&self) -> Sym2 {
        let [s1, s2] = self.here.first;
        let [e1, e2] = Frame::of(self.here.form).vectors();
        let (t1, t2) = (s1 * e1.x, s1 * e2.x + s2 * e2.y);
        let [d1, d2] = [0, 1].map(|j| tangential_part(self.derivative(j), [t1, t2]));
        let (along1, along2) = (d1 * e1.x, d1 * e2.x + d2 * e2.y);
        Sym2::new(
            inner_product(along1, along1),
            inner_product(along1, along2),
            inner_product(along2, along2),
        )
    }

    /// `Γ` of [`DifferenceForm::Literal`](super::DifferenceForm::Literal).
    pub(super) fn literal(&self) -> Sym2 {
        let Frame { b, c, .. } = Frame::of(self.here.form);
        let tangents = [DVec2::X, DVec2::new(b, c).normalize()];
        Sym2::outer(tangents[0]) * self.squared_differences(0)
            + Sym2::outer(tangents[1]) * self.squared_differences(1)
    }

    /// `(l_j⁺)² + (l_j⁻)²`; where one of them is missing the other counts twice.
    fn squared_differences(&self, j: usize) -> f64 {
        let squares = [2 * j, 2 * j + 1].map(|k| self.difference(k).powi(2));
        let known = squares.iter().filter(|square| !square.is_nan());
        2.0 * known.clone().sum::<f64>() / known.count().max(1) as f64
    }
}

/// A symmetric tensor in space as one of the tangent plane in these orthonormal tangents.
fn tangential_part(m: DMat3, [t1, t2]: [DVec3; 2]) -> Sym2 {
    Sym2::new(t1.dot(m * t1), t1.dot(m * t2), t2.dot(m * t2))
}

/// `⟨a, b⟩`, Frobenius's.
fn inner_product(a: Sym2, b: Sym2) -> f64 {
    a.xx * b.xx + 2.0 * a.xy * b.xy + a.yy * b.yy
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
pub(super) fn at_nodes<T: Clone + Default + Send>(
    surface: &dyn Surface,
    delta: f64,
    control: &Control,
    value: impl Fn(&Neighbourhood<'_>) -> T + Sync,
) -> Result<Vec<T>> {
    let (cols, rows) = (surface.cols(), surface.rows());
    let [across, down] = surface.periodic();
    let load = |row| nodes_of_row(surface, row, delta);
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
                let there = [east, west, south, north].map(|node| node.filter(|node| node.counts));
                *out = value(&Neighbourhood { here: &here[col], neighbours: there });
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

fn nodes_of_row(surface: &dyn Surface, row: usize, delta: f64) -> Vec<Node> {
    let jets = surface.row_space_jets(row).into_iter().enumerate();
    jets.map(|(col, jet)| Node::new(&jet, delta, surface.is_void(col, row))).collect()
}

/// The indices after and before `i` among `count`.
fn neighbours(i: usize, count: usize, periodic: bool) -> [Option<usize>; 2] {
    let after = if i + 1 < count { Some(i + 1) } else { periodic.then_some(0) };
    let before = if i > 0 { Some(i - 1) } else { periodic.then_some(count - 1) };
    [after, before]
}
