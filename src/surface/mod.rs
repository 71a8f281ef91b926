//! Heights become a smooth map with exact derivatives.
//!
//! [`HeightSurface`] fits a tensor-product B-spline to the heights of a terrain. `basis` has the splines of
//! one axis, `banded` the solver, `fit` the least squares along rows and then columns, `voids` the heights
//! that have no weight, `plan` the choice of knots and smoothing; `block` evaluates many nodes at once, `curvature`
//! says what the derivatives tell of the shape.
//!
//! [`ParametricSurface`] is what any surface in space has to give, [`NurbsSurface`] such a surface of any form.

mod banded;
mod basis;
mod block;
mod curvature;
mod fit;
mod height;
mod jets;
mod nurbs;
mod parametric;
mod plan;
mod residuals;
mod voids;

pub(crate) use self::block::{BLOCK, JetBlock, Lanes};
pub use self::curvature::Curvature;
pub use self::height::{Degree, FitOptions, HeightJet, HeightSurface, Smoothing};
pub(crate) use self::jets::SurfaceJets;
pub use self::nurbs::{Knots, NurbsCurve, NurbsGrid, NurbsSurface};
pub(crate) use self::parametric::Forms;
pub use self::parametric::{Measures, ParametricSurface, SurfaceJet};
pub use self::residuals::Residuals;
