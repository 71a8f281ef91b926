//! Metrics: how costly a step is at each place in each direction.
//!
//! A metric says what a small step `v` around a place `x` costs: `F(x, v) ≥ 0`, twice as much for a step twice as long, but not
//! always the same there and back. Most are *quadratic*: they have at every point a symmetric positive definite *speed tensor*
//! `D`, in the [axes](Surface::axes) of the surface (on heights ground axes, x east, y north, metres). Its dual `M = D⁻¹`
//! measures: `F(x, v) = √(vᵀ M v)`. Large `D` = fast = short. Eigenvalues of `D` are squared speeds.
//!
//! | metric | `D` | unit of the distance |
//! |---|---|---|
//! | [`Isotropic`] | `G⁻¹`, the inverse first fundamental form | m |
//! | [`Curvature`] | `Σ 1/(δ+\|κ_i\|) w_i w_iᵀ` (Seong, Jeong, Cohen 2008, equation 4) | AG units, `m·√(1/m)` |
//! | [`Difference`] | `Σ 1/(δ+γ_i) q_i q_iᵀ` (equations 5 and 6) | AG units, `m` |
//! | [`Tensor`] | the user's | units of the tensor |
//!
//! On the curvature metric a step along a direction of high normal curvature is costly, so routes turn
//! away from changing slopes and follow valleys, ridges and hillsides. On the difference metric a step is costly where the
//! curvature changes along it, so distances are short within a part of even shape and long from one part to the next.
//!
//! # Your own metric
//!
//! A metric is a type that implements [`Metric`]: its name, its unit, and on a surface its [`Norm`], most simply from a function
//! that gives `D`. Here ground that faces north is twice as slow:
//!
//! ```
//! use ridgeway::metric::{Metric, Norm, Unit};
//! use ridgeway::surface::{Jet, Surface};
//! use ridgeway::{Control, Modifiers, Result, Solver, Stop, Sym2, glam::DVec2};
//! # use ridgeway::{Crs, FitOptions, HeightSurface, synthetic::{Synthetic, SyntheticKind}};
//!
//! #[derive(Debug)]
//! struct Shady;
//!
//! impl Metric for Shady {
//!     fn name(&self) -> &str {
//!         "shady"
//!     }
//!
//!     fn unit(&self) -> Unit {
//!         Unit::Named("s")
//!     }
//!
//!     fn norm(&self, _: &dyn Surface, _: &Control) -> Result<Norm> {
//!         let squared_speed = |jet: &Jet| if jet.gradient().y < 0.0 { 0.25 } else { 1.0 };
//!         let tensor = move |_: DVec2, jet: &Jet| jet.first_form().inverse() * squared_speed(jet);
//!         Ok(Norm::quadratic(tensor))
//!     }
//! }
//!
//! # fn main() -> Result<()> {
//! # let control = Control::default();
//! # let terrain = Synthetic::new(SyntheticKind::Range, 40, 30, 25.0)?.terrain(Crs::none(), DVec2::ZERO)?;
//! # let surface = HeightSurface::fit(&terrain, &FitOptions::default(), &control)?;
//! let metric = Shady.on(&surface, &Modifiers::default(), &control)?;
//! let map = Solver::default().solve(&metric, &[DVec2::ZERO.into()], &Stop::Never, &control)?;
//! assert!(map.at_node(39, 29) > 0.0);
//! # Ok(())
//! # }
//! ```
//!
//! # Adding a metric to this crate
//!
//! It is a file of its own next to `isotropic.rs` that holds its [`NamedMetric`], and an entry in [`NAMED`], from which the command
//! and its help are made.

mod block;
mod curvature;
mod delta;
mod difference;
mod field;
mod isotropic;
mod modifiers;
mod nodes;
mod norm;
mod tensor;
mod unit;

use std::fmt;
use std::sync::Arc;

pub use self::block::SpeedBlock;
pub use self::curvature::Curvature;
pub(crate) use self::curvature::in_space as curvature_in_space;
pub use self::delta::Delta;
pub(crate) use self::delta::PLANE_BEND;
pub use self::difference::{Change, Difference, DifferenceForm};
pub use self::field::MetricField;
pub(crate) use self::field::length_along;
pub use self::isotropic::Isotropic;
pub use self::modifiers::Modifiers;
pub use self::norm::{Norm, Parameter, SpeedTensor, StepCost};
pub use self::tensor::Tensor;
pub use self::unit::Unit;
use crate::control::Control;
use crate::error::Result;
use crate::linalg::Sym2;
use crate::surface::Surface;

/// A metric and its parameters, not yet bound to a surface.
pub trait Metric: fmt::Debug + Send + Sync {
    /// Its name, for tables and files.
    fn name(&self) -> &str;

    /// Unit of its distances.
    fn unit(&self) -> Unit;

    /// Its norm on a surface: parameters that depend on the surface are determined, and what is known at the nodes only is
    /// computed.
    ///
    /// # Errors
    /// [`Error::Argument`](crate::Error::Argument) for parameters out of range and data that do not fit the surface;
    /// [`Error::Cancelled`](crate::Error::Cancelled).
    fn norm(&self, surface: &dyn Surface, control: &Control) -> Result<Norm>;

    /// The metric bound to a surface. Voids of the surface are barriers.
    ///
    /// # Errors
    /// Those of [`norm`](Self::norm); [`Error::Argument`](crate::Error::Argument) for a climb weight or slope out of range, a raster
    /// whose size is not the surface's, a cost that is finite but not positive, or costs too far apart.
    fn on<'a>(
        &self,
        surface: &'a dyn Surface,
        modifiers: &Modifiers,
        control: &Control,
    ) -> Result<MetricField<'a>> {
        MetricField::new(self, surface, modifiers, control)
    }
}

impl<M: Metric + ?Sized> Metric for Box<M> {
    fn name(&self) -> &str {
        (**self).name()
    }

    fn unit(&self) -> Unit {
        (**self).unit()
    }

    fn norm(&self, surface: &dyn Surface, control: &Control) -> Result<Norm> {
        (**self).norm(surface, control)
    }
}

/// The metrics of this crate, by name.
pub const NAMED: [NamedMetric; 5] =
    [isotropic::NAMED, curvature::NAMED, difference::RATE, difference::LITERAL, tensor::NAMED];

/// A metric that can be asked for by its name.
#[derive(Clone, Copy, Debug)]
pub struct NamedMetric {
    /// The name.
    pub name: &'static str,
    /// What it is, in a line.
    pub about: &'static str,
    make: fn(&MetricOptions) -> Result<Box<dyn Metric>>,
}

/// Parameters of the named metrics; each takes those that concern it.
#[derive(Clone, Debug, Default)]
pub struct MetricOptions {
    /// `δ` of the curvature tensor. Default: that of the metric.
    pub delta: Option<Delta>,
    /// `δ` of the difference tensor. Default: that of the metric.
    pub difference_delta: Option<Delta>,
    /// Speed tensors at the nodes, see [`Tensor`].
    pub tensors: Option<Arc<[Sym2]>>,
}

impl NamedMetric {
    /// The metric of this name; `None` if there is none.
    #[must_use]
    pub fn find(name: &str) -> Option<Self> {
        NAMED.into_iter().find(|metric| metric.name == name)
    }

    /// The metric with these options.
    ///
    /// # Errors
    /// [`Error::Argument`](crate::Error::Argument) if it needs tensors and the options have none.
    pub fn with(&self, options: &MetricOptions) -> Result<Box<dyn Metric>> {
        (self.make)(options)
    }
}
