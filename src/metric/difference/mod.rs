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

mod frame;
mod neighbourhood;
#[cfg(test)]
mod tests;

use rayon::prelude::*;

use self::frame::Frame;
use self::neighbourhood::at_nodes;
use super::nodes::{NodeTensors, Nodes};
use super::{Delta, Metric, MetricOptions, NamedMetric, Norm, Unit};
use crate::control::Control;
use crate::error::Result;
use crate::linalg::Sym2;
use crate::memory;
use crate::surface::Surface;

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
    /// `δ` of `1/(δ+γ)`. [`Delta::Auto`] is a share of the square of the mean of `√(γ1+γ2)` over the surface, but at least 1e-6
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
            Change { gamma, area: around.area() }
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
        let each = size_of::<Change>() + size_of::<Sym2>() + size_of::<f64>();
        let what = format!("the {} metric over", self.name());
        memory::check_cells(&what, [surface.cols(), surface.rows()], each)?;
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
