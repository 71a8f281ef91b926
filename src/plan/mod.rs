//! A question and its answer: which route, from where to where, over which ground.
//!
//! A [`Question`] names files, places and options; nothing is read yet. On the terrain it becomes a [`Scenario`]: the
//! surface, the places on the grid, and what closes ground or makes it costly. A scenario is asked for distances, routes and
//! comparisons under any metric. The command line, a server and other languages all ask like this; what they show is a report (data
//! for [`serde`]) with its [`Provenance`].
//!
//! In one call:
//!
//! ```
//! use ridgeway::plan::{self, Place};
//!
//! # fn main() -> ridgeway::Result<()> {
//! let (start, goal) = (Place::lonlat(-84.38, 36.21), Place::lonlat(-84.10, 36.39));
//! let route = plan::route("data/jacksboro.tif", start, goal)?;
//! assert!(route.summary.length_m > 30_000.0);
//! # Ok(())
//! # }
//! ```
//!
//! Several routes under a metric of choice:
//!
//! ```
//! use ridgeway::plan::{Place, Question};
//! use ridgeway::{Control, Isotropic};
//!
//! # fn main() -> ridgeway::Result<()> {
//! let control = Control::default();
//! let question = Question::new("data/jacksboro.tif")
//!     .from(Place::lonlat(-84.38, 36.21))
//!     .to(Place::lonlat(-84.10, 36.39))
//!     .to("pixel:40,60".parse()?);
//! let scenario = question.prepare(&control)?;
//! let metric = scenario.bind(&Isotropic, &control)?;
//! let routes = scenario.routes(&metric, &control)?;
//! assert_eq!(routes.len(), 2);
//! # Ok(())
//! # }
//! ```

mod geometry;
mod place;
mod provenance;
mod question;
mod rasters;
mod report;
mod route;
mod scenario;
mod site;
mod surface;

pub use self::geometry::read_geojson;
pub use self::place::{Notation, Place, coordinate};
pub use self::provenance::{MetricRecord, Provenance};
pub use self::question::Question;
pub use self::report::{
    ComparedRoute, ComparisonReport, Cost, CrsRecord, DemClimb, DistanceReport, DistanceStatistics,
    GoalDistance, InfoReport, MatchReport, MatchedPair, MatchedRegion, MatchedSurface, NamedRoute,
    RegionRecord, RouteReport, SegmentReport, SolverWork,
};
pub use self::route::route;
pub use self::scenario::Scenario;
pub use self::site::Site;
pub use self::surface::{describe_fit, describe_planned_fit};
