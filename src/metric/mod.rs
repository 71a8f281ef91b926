//! Who travels, and how costly a step is in each direction.
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
//! # A metric of one's own
//!
//! is a type that implements [`Metric`]: its name, its unit, and on a surface its [`Norm`], most simply from a function that
//! gives `D`. Here ground that faces north is twice as slow:
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
//!         let speed = |jet: &Jet| if jet.gradient().y < 0.0 { 0.5 } else { 1.0 };
//!         let tensor = move |_: DVec2, jet: &Jet| jet.first_form().inverse() * speed(jet).powi(2);
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
//! # Where a metric of this crate goes
//!
//! Into a file of its own beside `isotropic.rs`, with its [`NamedMetric`], and that into [`NAMED`]; the command and its help go by that
//! list.

mod block;
mod curvature;
mod delta;
mod difference;
mod field;
mod isotropic;
mod modifiers;
mod nodes;
mod tensor;
mod unit;

use std::fmt;
use std::sync::Arc;

use glam::DVec2;

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
pub use self::tensor::Tensor;
pub use self::unit::Unit;
use crate::control::Control;
use crate::error::Result;
use crate::linalg::Sym2;
use crate::surface::{Block, Jet, JetBlock, Surface};

/// A way of measuring distance, as it is asked for: not yet on a surface.
pub trait Metric: fmt::Debug + Send + Sync {
    /// Its name, for tables and files.
    fn name(&self) -> &str;

    /// Unit of its distances.
    fn unit(&self) -> Unit;

    /// What it is on a surface: parameters that depend on the surface are settled, and what is known at the nodes only is
    /// computed.
    ///
    /// # Errors
    /// Parameters out of range, data that do not fit the surface; cancelled.
    fn norm(&self, surface: &dyn Surface, control: &Control) -> Result<Norm>;

    /// The metric bound to a surface. Voids of the surface are barriers.
    ///
    /// # Errors
    /// Those of [`norm`](Self::norm); a climb weight or slope out of range; a raster whose size is not the surface's; a cost that
    /// is finite but not positive, or costs too far apart.
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

/// What a step costs on a surface: the function `F`, and the numbers that say which.
#[derive(Clone)]
pub struct Norm {
    form: Form,
    parameters: Vec<Parameter>,
    level: Option<f64>,
    seed_ranks: Option<Arc<Vec<f64>>>,
}

#[derive(Clone)]
enum Form {
    Quadratic(Arc<dyn SpeedTensor>),
    General(Arc<dyn StepCost>),
}

/// A number that a metric depends on, for the record.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameter {
    /// Its name in files, with its unit: `delta_per_m`.
    pub name: &'static str,
    /// Its value.
    pub value: f64,
    /// Its unit, empty if it has none.
    pub unit: &'static str,
}

impl Norm {
    /// `F(x, v) = √(vᵀ D(x)⁻¹ v)`.
    #[must_use]
    pub fn quadratic(tensor: impl SpeedTensor + 'static) -> Self {
        Self::new(Form::Quadratic(Arc::new(tensor)))
    }

    /// Any `F`. Lengths are measured with it; [`Solver`](crate::Solver) and [`trace`](crate::route::trace) need a quadratic one and
    /// refuse it.
    #[must_use]
    pub fn general(cost: impl StepCost + 'static) -> Self {
        Self::new(Form::General(Arc::new(cost)))
    }

    fn new(form: Form) -> Self {
        Self { form, parameters: Vec::new(), level: None, seed_ranks: None }
    }

    /// The same with one more parameter on the record.
    #[must_use]
    pub fn with_parameter(mut self, name: &'static str, value: f64, unit: &'static str) -> Self {
        self.parameters.push(Parameter { name, value, unit });
        self
    }

    /// The same, known to cost `√level` per metre of level ground of even shape: what a [climb weight](Modifiers::climb_weight) is
    /// weighed against.
    #[must_use]
    pub fn with_level(mut self, level: f64) -> Self {
        self.level = Some(level);
        self
    }

    /// The same with a number for each node, row-major, that is least where the norm changes least: regions grow from there
    /// first. Without, they grow from where the Gaussian curvature is least.
    #[must_use]
    pub fn with_seed_ranks(mut self, ranks: Vec<f64>) -> Self {
        self.seed_ranks = Some(Arc::new(ranks));
        self
    }

    /// `F(x, v)`: the cost of a small step `v`, in the axes of the surface, around grid coordinates `at`, where the surface has this jet.
    #[must_use]
    pub fn cost(&self, at: DVec2, jet: &Jet, v: DVec2) -> f64 {
        match &self.form {
            Form::Quadratic(tensor) => tensor.speed(at, jet).inverse().norm(v),
            Form::General(cost) => cost.cost(at, jet, v),
        }
    }

    /// The speed tensor, if `F` is quadratic.
    #[must_use]
    pub fn tensor(&self) -> Option<&dyn SpeedTensor> {
        match &self.form {
            Form::Quadratic(tensor) => Some(&**tensor),
            Form::General(_) => None,
        }
    }

    /// See [`with_parameter`](Self::with_parameter).
    #[must_use]
    pub fn parameters(&self) -> &[Parameter] {
        &self.parameters
    }

    /// See [`with_level`](Self::with_level).
    #[must_use]
    pub fn level(&self) -> Option<f64> {
        self.level
    }

    /// See [`with_seed_ranks`](Self::with_seed_ranks).
    #[must_use]
    pub fn seed_ranks(&self) -> Option<&[f64]> {
        self.seed_ranks.as_ref().map(|ranks| &ranks[..])
    }
}

impl fmt::Debug for Norm {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let is_quadratic = matches!(self.form, Form::Quadratic(_));
        f.debug_struct("Norm")
            .field("quadratic", &is_quadratic)
            .field("parameters", &self.parameters)
            .finish_non_exhaustive()
    }
}

/// The speed tensor `D` of a quadratic norm. A function of place and jet is one.
pub trait SpeedTensor: Send + Sync {
    /// `D` at grid coordinates `at`, where the surface has this jet, in the axes of the surface. Nobody enters where it is not
    /// positive definite.
    fn speed(&self, at: DVec2, jet: &Jet) -> Sym2;

    /// The same with its determinant, for those that know it better than from the entries.
    fn speed_and_det(&self, at: DVec2, jet: &Jet) -> (Sym2, f64) {
        let d = self.speed(at, jet);
        (d, d.det())
    }

    /// `D` at the nodes of a block, where the surface has these jets. For those that do many faster than one by one.
    fn block(&self, block: &Block, jets: &JetBlock, speeds: &mut SpeedBlock) {
        one_by_one(self, block, jets, speeds);
    }

    /// Whether a node has a tensor; where tensors are given node by node, some may have none.
    fn is_open(&self, col: usize, row: usize) -> bool {
        let _ = (col, row);
        true
    }
}

fn one_by_one(
    tensor: &(impl SpeedTensor + ?Sized),
    block: &Block,
    jets: &JetBlock,
    speeds: &mut SpeedBlock,
) {
    for (j, i, at) in block.nodes() {
        speeds.set_with(j, i, tensor.speed_and_det(at, &jets.get(j, i)));
    }
}

impl<F: Fn(DVec2, &Jet) -> Sym2 + Send + Sync> SpeedTensor for F {
    fn speed(&self, at: DVec2, jet: &Jet) -> Sym2 {
        self(at, jet)
    }
}

/// The cost of a step in general. A function of place, jet and step is one.
pub trait StepCost: Send + Sync {
    /// `F(x, v)`, see [`Norm::cost`]: not negative, `F(x, tv) = t F(x, v)` for `t > 0`. It need not be `F(x, −v)`.
    fn cost(&self, at: DVec2, jet: &Jet, v: DVec2) -> f64;
}

impl<F: Fn(DVec2, &Jet, DVec2) -> f64 + Send + Sync> StepCost for F {
    fn cost(&self, at: DVec2, jet: &Jet, v: DVec2) -> f64 {
        self(at, jet, v)
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

/// What the named metrics can be told; each looks at what concerns it.
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
    /// The one of this name.
    #[must_use]
    pub fn find(name: &str) -> Option<Self> {
        NAMED.into_iter().find(|metric| metric.name == name)
    }

    /// The metric with options.
    ///
    /// # Errors
    /// It lacks something: tensors.
    pub fn with(&self, options: &MetricOptions) -> Result<Box<dyn Metric>> {
        (self.make)(options)
    }
}
