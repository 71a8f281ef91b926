//! What a step costs on a surface.

use std::fmt;
use std::sync::Arc;

use glam::DVec2;

use super::SpeedBlock;
use crate::linalg::Sym2;
use crate::surface::{Block, Jet, JetBlock};

/// What a step costs on a surface: the function `F`, and for the record the parameters it was made with.
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

    /// The same, known to cost `√level` per metre of level ground of constant shape: what a [climb weight](super::Modifiers::climb_weight) is
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
    /// `D` at grid coordinates `at`, where the surface has this jet, in the axes of the surface. A place is closed where it is not
    /// positive definite.
    fn speed(&self, at: DVec2, jet: &Jet) -> Sym2;

    /// The same with its determinant. To be overridden where that is known more accurately than from the entries.
    fn speed_and_det(&self, at: DVec2, jet: &Jet) -> (Sym2, f64) {
        let d = self.speed(at, jet);
        (d, d.det())
    }

    /// `D` at the nodes of a block, where the surface has these jets. To be overridden where many together are faster than one by one.
    fn block(&self, block: &Block, jets: &JetBlock, speeds: &mut SpeedBlock) {
        one_by_one(self, block, jets, speeds);
    }

    /// Whether tensors are known at the nodes only. Their size is then a cost of the node, see [`node_cost`](Self::node_cost), and a cell is given
    /// what is left of them.
    fn is_known_at_nodes(&self) -> bool {
        false
    }

    /// The cost of a node: `det(D)^(−1/4)` where tensors [are known at the nodes only](Self::is_known_at_nodes), else 1.
    fn node_cost(&self, col: usize, row: usize) -> f64 {
        let _ = (col, row);
        1.0
    }

    /// Whether a node has a tensor; where tensors are given node by node, some may have none.
    fn is_open(&self, col: usize, row: usize) -> bool {
        let _ = (col, row);
        true
    }
}

/// The tensors of a block one after the other.
pub(super) fn one_by_one(
    tensor: &(impl SpeedTensor + ?Sized),
    block: &Block,
    jets: &JetBlock,
    speeds: &mut SpeedBlock,
) {
    for (j, i, at) in block.places() {
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
