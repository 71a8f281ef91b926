//! Flags of the commands about regions: `segment`, `match`.

use std::path::PathBuf;

use clap::Args;
use ridgeway::Solver;
use ridgeway::region::SegmentOptions;

use super::ground::{GroundArgs, MetricChoice};
use super::values::{positive, share, size};

#[derive(Debug, Args)]
#[command(after_help = "\
The terrain is covered with clusters: all cells within a distance epsilon of a seed, the flattest cell not
covered yet. Each cell then belongs to the region of its nearest seed. With --levels every region is cut
again.

Examples:
  ridgeway segment valley.tif -o regions.geojson -o regions.png
  ridgeway segment valley.tif --levels 2 -o regions.tif
  ridgeway segment valley.tif --epsilon 40,15 -o regions.geojson --json")]
pub(crate) struct SegmentArgs {
    /// The DEM.
    pub(crate) dem: PathBuf,
    #[command(flatten)]
    pub(crate) choice: MetricChoice,
    /// The file to write: .geojson (polygons with statistics), .tif (number of each cell's region, a band per level; 0 for
    /// none) or .png (map); may be given several times.
    #[arg(short, long, value_name = "FILE")]
    pub(crate) output: Vec<PathBuf>,
    /// Replace files that exist.
    #[arg(long)]
    pub(crate) overwrite: bool,
    #[command(flatten)]
    pub(crate) regions: RegionArgs,
    #[command(flatten)]
    pub(crate) ground: GroundArgs,
}

#[derive(Debug, Args)]
#[command(after_help = "\
Each surface is cut into regions, as by `segment`. What tells regions apart is how the curvature tensor varies
over them, in four numbers that know nothing of place, direction, size or grid. The two regions most alike are
matched first, then the two most alike of the others.

Examples:
  ridgeway match valley.tif other.tif -o matches
  ridgeway match letter.json --levels 2 --nodes 100x200")]
pub(crate) struct MatchArgs {
    /// One or two surfaces: DEMs, or NURBS surfaces in .json files.
    #[arg(required = true, num_args = 1..=2, value_name = "SURFACE")]
    pub(crate) surfaces: Vec<PathBuf>,
    #[command(flatten)]
    pub(crate) choice: MetricChoice,
    /// Let sizes count as well as shapes.
    #[arg(long)]
    pub(crate) sized: bool,
    /// Nodes along the two parameters of a NURBS surface.
    #[arg(long, value_name = "COLSxROWS", default_value = "200x200", value_parser = size)]
    pub(crate) nodes: (usize, usize),
    /// The folder to write: matches.json, regions.png (a matched pair in one colour), signatures.png (λ1 and λ2).
    #[arg(short, long, value_name = "FOLDER")]
    pub(crate) output: Option<PathBuf>,
    /// Replace files that exist.
    #[arg(long)]
    pub(crate) overwrite: bool,
    #[command(flatten)]
    pub(crate) regions: RegionArgs,
    #[command(flatten)]
    pub(crate) ground: GroundArgs,
}

/// How to cut a surface into regions.
#[derive(Debug, Args)]
#[command(next_help_heading = "Regions")]
pub(crate) struct RegionArgs {
    /// Radius of the clusters in the unit of the metric; several, falling, for as many levels [default: half of the largest
    /// distance from the first seed, in each region anew].
    #[arg(long, value_name = "VALUE", value_delimiter = ',', value_parser = positive, allow_hyphen_values = true)]
    pub(crate) epsilon: Vec<f64>,
    /// How often to cut: the surface, then its regions, then theirs [default: 1, or one for each --epsilon].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(1..=8))]
    pub(crate) levels: Option<u8>,
    /// Join neighbours on the last level whose signatures differ by at most this much, between 0 (none) and 1 (all).
    #[arg(long, value_name = "TOLERANCE", value_parser = share, allow_hyphen_values = true)]
    pub(crate) merge: Option<f64>,
}

impl RegionArgs {
    pub(crate) fn options(&self, solver: Solver) -> SegmentOptions {
        SegmentOptions {
            levels: self.levels.map_or(self.epsilon.len().max(1), usize::from),
            epsilons: self.epsilon.clone(),
            solver,
        }
    }
}
