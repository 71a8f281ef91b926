//! Regions and pairs of like ones.

use std::path::Path;

use serde::Serialize;

use crate::metric::Unit;
use crate::plan::provenance::{Provenance, SOFTWARE, file_name};
use crate::region::{Match, Region, RegionStatistics, Signature};

/// The regions of a surface.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SegmentReport {
    /// The metric.
    pub metric: String,
    /// Unit of the radii.
    pub unit: Unit,
    /// `δ` of the metric in 1/m, if it has one.
    pub delta_per_m: Option<f64>,
    /// The regions of all levels.
    pub regions: Vec<RegionRecord>,
    /// How to ask again.
    pub provenance: Provenance,
}

/// A region, as it stands in a file: numbers count from 1.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RegionRecord {
    /// Its level.
    pub level: usize,
    /// Its number on that.
    pub region: usize,
    /// The region of the level above that it is part of.
    pub parent: Option<u32>,
    /// Radius of its cluster, see [`Region::epsilon`].
    pub epsilon: f64,
    /// Unit of the radius.
    pub epsilon_unit: Unit,
    /// Map coordinates of its seed.
    pub seed: [f64; 2],
    /// Eigenvalues that describe its shape.
    pub signature: [f64; 4],
    /// What it is like.
    #[serde(flatten)]
    pub statistics: RegionStatistics,
}

impl RegionRecord {
    /// The record of region `number` of `level`, both counted from 0, whose seed lies at map coordinates `seed`.
    #[must_use]
    pub fn new(
        [level, number]: [usize; 2],
        region: &Region,
        seed: [f64; 2],
        (statistics, signature): &(RegionStatistics, Signature),
        unit: Unit,
    ) -> Self {
        Self {
            level: level + 1,
            region: number + 1,
            parent: region.parent.map(|parent| parent + 1),
            epsilon: region.epsilon,
            epsilon_unit: unit,
            seed,
            signature: signature.eigenvalues,
            statistics: *statistics,
        }
    }
}

/// Regions of like shape on one surface or two.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MatchReport {
    /// The surfaces.
    pub surfaces: Vec<MatchedSurface>,
    /// The pairs, the most alike first.
    pub matches: Vec<MatchedPair>,
    /// Name and version of this crate.
    pub software: &'static str,
    /// The command line, if there was one.
    pub command: Option<String>,
}

/// A surface and its regions.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MatchedSurface {
    /// The file.
    pub file: String,
    /// Its regions.
    pub regions: Vec<MatchedRegion>,
}

/// A region that may be matched.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MatchedRegion {
    /// Its number, from 1.
    pub region: usize,
    /// Its seed: map coordinates, or a point in space.
    pub seed: Vec<f64>,
    /// Its size `√area` in metres.
    pub size_m: f64,
    /// Eigenvalues that describe its shape.
    pub signature: [f64; 4],
}

/// Two regions that are alike.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct MatchedPair {
    /// Number of the region of the first surface.
    pub first: usize,
    /// Number of the region of the second surface.
    pub second: usize,
    /// How unlike they are, 0 to 1, see [`Match::distance`]; files have it under the name of their first version.
    #[serde(rename = "unlikeness")]
    pub dissimilarity: f64,
    /// Size of the second as a multiple of the first's.
    pub size_ratio: f64,
    /// Whether each is the most similar to the other of all.
    pub mutual: bool,
}

impl MatchReport {
    /// The matches that were found among surfaces.
    #[must_use]
    pub fn new(surfaces: Vec<MatchedSurface>, found: &[Match], command: Option<String>) -> Self {
        let matches = found.iter().map(MatchedPair::from).collect();
        Self { surfaces, matches, software: SOFTWARE, command }
    }
}

impl From<&Match> for MatchedPair {
    fn from(pair: &Match) -> Self {
        Self {
            first: pair.first + 1,
            second: pair.second + 1,
            dissimilarity: pair.distance,
            size_ratio: pair.size_ratio,
            mutual: pair.mutual,
        }
    }
}

impl MatchedSurface {
    /// The regions of the surface in `file`, with their seeds and signatures.
    #[must_use]
    pub fn new(file: &Path, regions: impl Iterator<Item = (Vec<f64>, Signature)>) -> Self {
        let regions = (1..).zip(regions).map(|(region, (seed, signature))| MatchedRegion {
            region,
            seed,
            size_m: signature.size,
            signature: signature.eigenvalues,
        });
        Self { file: file_name(file), regions: regions.collect() }
    }
}
