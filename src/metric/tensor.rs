//! The user's own speed tensors.

use std::sync::Arc;

use super::nodes::{NodeTensors, Nodes};
use super::{Metric, MetricOptions, NamedMetric, Norm, Unit};
use crate::control::Control;
use crate::error::{Error, Result};
use crate::linalg::Sym2;
use crate::surface::Surface;

pub(super) const NAMED: NamedMetric = NamedMetric {
    name: "tensor",
    about: "Your own speed tensors at the nodes, in AG units",
    make: |options: &MetricOptions| match &options.tensors {
        Some(tensors) => Ok(Box::new(Tensor { tensors: Arc::clone(tensors) })),
        None => Err(Error::argument(
            "the tensors of the metric `tensor`",
            "missing",
            "given, one at each node",
        )),
    },
};

/// Speed tensors `D` of any origin at the nodes, bilinear between them.
#[derive(Clone, Debug)]
pub struct Tensor {
    /// Row-major from the first node, in the [axes](Surface::axes) of the surface: on heights ground axes (x east, y north), in
    /// space grid coordinates. A node whose tensor is not finite is a barrier.
    pub tensors: Arc<[Sym2]>,
}

impl Metric for Tensor {
    fn name(&self) -> &str {
        NAMED.name
    }

    fn unit(&self) -> Unit {
        Unit::Ag
    }

    /// # Errors
    /// [`Error::Argument`] if there is not one tensor per node, or one is finite but not positive definite.
    fn norm(&self, surface: &dyn Surface, _: &Control) -> Result<Norm> {
        check_tensors(surface, &self.tensors)?;
        let tensors = Arc::clone(&self.tensors);
        Ok(Norm::quadratic(NodeTensors { nodes: Nodes::of(surface), tensors }))
    }
}

/// Refuses tensors of another number than nodes, and finite ones that are not positive definite.
fn check_tensors(surface: &dyn Surface, tensors: &[Sym2]) -> Result<()> {
    let (cols, rows) = (surface.cols(), surface.rows());
    if tensors.len() != cols * rows {
        return Err(Error::argument(
            "the number of tensors",
            tensors.len(),
            format!("{}, that of the nodes", cols * rows),
        ));
    }
    let finite = |d: &Sym2| d.xx.is_finite() && d.xy.is_finite() && d.yy.is_finite();
    match tensors.iter().position(|d| finite(d) && !d.is_positive_definite()) {
        None => Ok(()),
        Some(i) => {
            let d = tensors[i];
            Err(Error::argument(
                "the tensor D",
                format!("[{} {}; {} {}]", d.xx, d.xy, d.xy, d.yy),
                "positive definite: D11 > 0 and D11·D22 > D12²",
            )
            .at_node(i % cols, i / cols)
            .advise("mark barriers by NaN"))
        }
    }
}
