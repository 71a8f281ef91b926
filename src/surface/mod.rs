//! Heights become a smooth map with exact derivatives.
//!
//! [`HeightSurface`] fits a tensor-product B-spline (`bspline/`) to the heights of a terrain; `curvature` says what the
//! derivatives tell of the shape.
//!
//! [`ParametricSurface`] is what any surface in space has to give, [`NurbsSurface`] such a surface of any form.

mod bspline;
mod curvature;
mod height;
mod jets;
mod nurbs;
mod parametric;

pub(crate) use self::bspline::block::{BLOCK, JetBlock, Lanes};
pub use self::bspline::residuals::Residuals;
pub use self::curvature::Curvature;
pub use self::height::{Degree, FitOptions, HeightJet, HeightSurface, Smoothing};
pub(crate) use self::jets::SurfaceJets;
pub use self::nurbs::{Knots, NurbsCurve, NurbsGrid, NurbsSurface};
pub(crate) use self::parametric::Forms;
pub use self::parametric::{Measures, ParametricSurface, SurfaceJet};
