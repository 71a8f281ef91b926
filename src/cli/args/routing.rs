//! Flags of the commands that solve distances: `distance`, `route`, `compare`.

use std::path::PathBuf;

use clap::Args;
use ridgeway::metric::NamedMetric;
use ridgeway::plan::Place;

use super::ground::{GroundArgs, MetricChoice, metric};
use super::values::{not_negative, place, positive};

#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  ridgeway distance valley.tif --start 388400,4711200 -o distance.tif --direction
  ridgeway distance valley.tif --start spring.geojson --metric isotropic --isolines rings.geojson --step 1000")]
pub(crate) struct DistanceArgs {
    /// The DEM.
    pub(crate) dem: PathBuf,
    #[command(flatten)]
    pub(crate) start: StartArgs,
    /// Places whose distance to print; may be given several times.
    #[arg(long, value_name = "PLACE", value_parser = place, allow_hyphen_values = true)]
    pub(crate) goal: Vec<Place>,
    #[command(flatten)]
    pub(crate) choice: MetricChoice,
    /// The GeoTIFF to write; cells that cannot be reached are nodata.
    #[arg(short, long, value_name = "FILE.tif")]
    pub(crate) output: Option<PathBuf>,
    /// Replace files that exist.
    #[arg(long)]
    pub(crate) overwrite: bool,
    /// Add a band with the direction of travel from the start, degrees clockwise from north.
    #[arg(long, requires = "output")]
    pub(crate) direction: bool,
    /// Which start each cell is nearest to, as a GeoTIFF: 1 for the first --start, 2 for the second, ...; 0 where not
    /// reached. A file of several shapes is one start.
    #[arg(long, value_name = "FILE.tif")]
    pub(crate) labels: Option<PathBuf>,
    /// Go no farther than this distance, in the unit of the metric; cells beyond are nodata.
    #[arg(long, value_name = "VALUE", conflicts_with = "goal", value_parser = not_negative, allow_hyphen_values = true)]
    pub(crate) max_distance: Option<f64>,
    /// Lines of equal distance, as GeoJSON.
    #[arg(long, value_name = "FILE.geojson")]
    pub(crate) isolines: Option<PathBuf>,
    /// Distance between isolines, in the unit of the metric [default: a round number giving about twenty].
    #[arg(long, value_name = "VALUE", requires = "isolines", value_parser = positive, allow_hyphen_values = true)]
    pub(crate) step: Option<f64>,
    /// Print quantiles of the distance, of its error with --accuracy high, and how much work the solver had.
    #[arg(long)]
    pub(crate) stats: bool,
    /// Add a band with an estimate of the error; needs --accuracy high.
    #[arg(long, requires = "output")]
    pub(crate) error: bool,
    #[command(flatten)]
    pub(crate) ground: GroundArgs,
}

#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  ridgeway route valley.tif --start 388400,4711200 --goal 391250,4709800 -o route.geojson
  ridgeway route valley.tif --start pixel:40,60 --goal huts.geojson --metric isotropic \
--climb-weight 20 -o routes.gpx")]
pub(crate) struct RouteArgs {
    /// The DEM.
    pub(crate) dem: PathBuf,
    #[command(flatten)]
    pub(crate) start: StartArgs,
    /// Where to go; may be given several times, for one route each.
    #[arg(long, value_name = "PLACE", value_parser = place, required = true, allow_hyphen_values = true)]
    pub(crate) goal: Vec<Place>,
    #[command(flatten)]
    pub(crate) choice: MetricChoice,
    /// The file to write: .geojson, .gpx or .csv (a profile); may be given several times.
    #[arg(short, long, value_name = "FILE")]
    pub(crate) output: Vec<PathBuf>,
    /// Replace files that exist.
    #[arg(long)]
    pub(crate) overwrite: bool,
    #[command(flatten)]
    pub(crate) ground: GroundArgs,
}

#[derive(Debug, Args)]
#[command(after_help = "\
The table and the folder hold, for every route, its length, climb, grades, total normal curvature
and its cost under every metric as a ratio to the best route under that metric.

Example:
  ridgeway compare valley.tif --start 388400,4711200 --goal 391250,4709800 -o comparison")]
pub(crate) struct CompareArgs {
    /// The DEM.
    pub(crate) dem: PathBuf,
    #[command(flatten)]
    pub(crate) start: StartArgs,
    /// Where to go.
    #[arg(long, value_name = "PLACE", value_parser = place, allow_hyphen_values = true)]
    pub(crate) goal: Place,
    /// The metrics [default: isotropic,curvature,difference, and tensor with --tensor].
    #[arg(long, value_parser = metric(), value_name = "METRIC", value_delimiter = ',')]
    pub(crate) metrics: Vec<NamedMetric>,
    /// The folder to write: routes.geojson, profile.csv, summary.json, map.png.
    #[arg(short, long, value_name = "FOLDER")]
    pub(crate) output: Option<PathBuf>,
    /// Replace files that exist.
    #[arg(long)]
    pub(crate) overwrite: bool,
    #[command(flatten)]
    pub(crate) ground: GroundArgs,
}

/// Where distance is zero.
#[derive(Debug, Args)]
pub(crate) struct StartArgs {
    /// Where to start; may be given several times: the nearest start counts.
    #[arg(long, value_name = "PLACE", value_parser = place, required = true, allow_hyphen_values = true)]
    pub(crate) start: Vec<Place>,
}
