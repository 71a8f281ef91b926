//! Ridgeway plans routes over terrain by *anisotropic geodesic* distance.
//!
//! Ordinary geodesics minimise length alone. On the curvature metric a step is costly where the ground bends along it, so
//! routes keep to valleys, ridges and hillsides, as mountain roads do. The method is that of Seong, Jeong and
//! Cohen, *Anisotropic Geodesic Distance Computation for Parametric Surfaces* (SMI 2008).
//!
//! # A tour, in the order the data flows
//!
//! ```text
//! terrain ──▶ surface ──▶ metric ──▶ eikonal ──▶ route ──▶ export, render
//! heights     z(x, y),    D at any   g, the      a line,   GeoJSON, GPX, CSV,
//! in metres   exact       point      distance    numbers   GeoTIFF, PNG
//!             derivatives
//! ```
//!
//! ```
//! use ridgeway::route::trace;
//! use ridgeway::{Control, Curvature, FitOptions, HeightSurface, Metric, Modifiers, Solver, Stop, Terrain};
//!
//! # fn main() -> Result<(), ridgeway::Error> {
//! let control = Control::default();
//! let terrain = Terrain::open("data/jacksboro.tif")?;
//! let surface = HeightSurface::fit(&terrain, &FitOptions::default(), &control)?;
//! let metric = Curvature::default().on(&surface, &Modifiers::default(), &control)?;
//!
//! let start = terrain.frame().to_grid(glam::DVec2::new(-84.38, 36.21));
//! let goal = terrain.frame().to_grid(glam::DVec2::new(-84.10, 36.39));
//! let distance = Solver::default().solve(&metric, &[start.into()], &Stop::AllGoals(vec![goal]), &control)?;
//! let route = trace(&distance, &metric, goal)?;
//! assert!(route.summary.length_m > 30_000.0);
//! # Ok(())
//! # }
//! ```
//!
//! * [`terrain`]: [`Terrain::open`] reads GeoTIFF, ESRI ASCII grids and SRTM tiles; [`synthetic`] makes terrains
//!   with known answers. Heights are metres, voids `NaN`, row 0 is north.
//! * [`surface`]: [`HeightSurface::fit`] makes the tensor-product B-spline `z(x, y)`; a [`HeightJet`] is its value and
//!   exact derivatives at a point, [`surface::PrincipalCurvatures`] what they say of the shape. What follows takes any [`Surface`]: a
//!   [`NurbsGrid`] and a user's own as well.
//! * [`metric`]: [`Metric::on`] binds a metric to a surface, [`Isotropic`], [`Curvature`], [`Difference`] or a user's own:
//!   [`MetricField::speed`] is the tensor `D` there.
//! * [`eikonal`]: [`Solver::solve`] solves `√(∇gᵀ D ∇g) = 1` from a [`StartRegion`] into a [`DistanceMap`].
//! * [`route`]: [`route::trace`] descends on `g` from the goal; a [`Route`] carries its numbers; [`Comparison`] sets several
//!   metrics side by side.
//! * [`region`]: [`region::Segmentation`] cuts a surface into regions of like shape; [`region::signatures`] and
//!   [`region::match_regions`] find like ones on other surfaces.
//! * [`export`], [`render`]: files and pictures.
//!
//! # Units, frames, signs
//!
//! | quantity | unit | frame and sign |
//! |---|---|---|
//! | grid coordinates | nodes | `(column, row)` from the north-west node, row southward ([`GridFrame`]) |
//! | map coordinates | those of the CRS | x east, y north |
//! | heights, lengths | m | also on a DEM in degrees or feet |
//! | derivatives of height | 1, 1/m | ground axes: x east, y **north** |
//! | curvature `κ` | 1/m | positive where the ground bends towards the upward normal: a hollow |
//! | speed tensor `D`, metric `M = D⁻¹` | | ground axes; large `D` = fast = short |
//! | distance `g` | m, or AG units ([`MetricField::unit`]) | 0 on the start region |
//!
//! Work runs on the current rayon pool, and no result depends on the number of threads, not in one bit.
//! Nothing panics on data; see [`Error`].
//!
//! # Features
//!
//! Without features (`default-features = false`) a DEM is read, a surface fitted, distances solved and routes traced.
//!
//! * `export`: files of routes, isolines, regions and rasters ([`export`]).
//! * `plan`: questions and reports, with `export` ([`plan`]).
//! * `render`: pictures ([`render`]).
//! * `lzma`: GeoTIFF that is compressed by LZMA is read too.
//! * `zip`: SRTM tiles are read from zip archives too.
//! * `cli` (default): the `ridgeway` command, with all of the above.

#![warn(clippy::print_stdout, clippy::print_stderr)]

mod control;
pub mod eikonal;
pub mod error;
#[cfg(feature = "export")]
pub mod export;
pub mod grid;
pub mod linalg;
mod memory;
pub mod metric;
#[cfg(feature = "plan")]
pub mod plan;
pub mod region;
#[cfg(feature = "render")]
pub mod render;
pub mod route;
pub mod surface;
pub mod synthetic;
pub mod terrain;

pub use control::{CancelToken, Control, Progress};
pub use eikonal::{Accuracy, DistanceMap, Solver, StartRegion, Stop};
pub use error::{Error, Result};
pub use geo_types;
pub use glam;
pub use grid::{GridFrame, Ground};
pub use linalg::Sym2;
pub use metric::{Curvature, Delta, Difference, Isotropic, Metric, MetricField, Modifiers, Unit};
pub use route::{Comparison, Route};
pub use surface::{
    Degree, FitOptions, HeightJet, HeightSurface, Jet, Knots, NurbsCurve, NurbsGrid, NurbsSurface,
    Smoothing, Surface, SurfaceJet,
};
pub use terrain::{Crs, Terrain};
