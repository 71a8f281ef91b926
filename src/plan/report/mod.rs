//! Answers as data, for machines: what the command prints with `--json` and a server would send.

mod distance;
mod info;
mod regions;
mod routes;

pub use self::distance::{DistanceReport, DistanceStatistics, GoalDistance, SolverWork};
pub use self::info::{CrsRecord, InfoReport};
pub use self::regions::{
    MatchReport, MatchedPair, MatchedRegion, MatchedSurface, RegionRecord, SegmentReport,
};
pub use self::routes::{ComparedRoute, ComparisonReport, Cost, DemClimb, NamedRoute, RouteReport};
