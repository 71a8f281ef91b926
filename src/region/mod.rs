//! Regions of a surface: local shape clusters and the segmentation they seed.
//!
//! A *local shape cluster* `D_ε(p)` is a seed `p` and all points within distance `ε` of it. On the curvature metric it is large
//! where the surface is flat and small where it bends. A [`Segmentation`] covers the surface with clusters of one `ε` and
//! gives each point to the seed nearest to it; borders then fall where fronts are slow, on ridges and valleys. Each region can be cut again
//! with a smaller `ε`. (Seong, Jeong and Cohen, SMI 2008, definition 4.1 and section 5.1.)
//!
//! Distances come from a [`TensorField`](crate::eikonal::TensorField) alone, whatever surface and metric it is of;
//! [`signatures`] put the shapes of regions into numbers and [`match_regions`] finds like ones; [`region_statistics`]
//! measures the regions on a [`Surface`](crate::Surface).

mod clusters;
mod matching;
mod merging;
mod outline;
mod segmentation;
mod signature;
mod statistics;

pub use self::clusters::{cluster, gaussian_ranks};
pub use self::matching::{Match, match_regions, match_regions_within};
pub use self::outline::outlines;
pub use self::segmentation::{Level, Region, SegmentOptions, Segmentation};
pub use self::signature::{Neighbours, Signature, signatures};
pub use self::statistics::{RegionStatistics, region_statistics};
