//! Ridgeway plans routes over terrain by anisotropic geodesic distance.

#![warn(clippy::print_stdout, clippy::print_stderr)]
#![allow(unused, clippy::todo, reason = "skeleton")]

mod control;
pub mod eikonal;
mod error;
pub mod export;
mod grid;
pub mod metric;
pub mod render;
pub mod route;
pub mod surface;
pub mod terrain;

pub use control::{CancelToken, Control, Progress};
pub use eikonal::{DistanceMap, Solver, StartRegion};
pub use error::{Error, Result};
pub use grid::{GridFrame, Ground};
pub use metric::{Delta, Metric, MetricField, Modifiers, Sym2};
pub use route::{Comparison, Route};
pub use surface::{Degree, FitOptions, HeightJet, HeightSurface, Smoothing};
pub use terrain::{Crs, Terrain};
