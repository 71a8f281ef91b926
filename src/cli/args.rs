//! The command line as the user writes it: flags, their help and their parsers. No file is touched here.

use std::path::PathBuf;
use std::sync::Arc;

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use clap::{Args, Parser, Subcommand, ValueEnum};
use glam::DVec2;
use ridgeway::metric::{MetricOptions, NAMED, NamedMetric};
use ridgeway::region::SegmentOptions;
use ridgeway::{Accuracy, Degree, Delta, Error, FitOptions, Metric, Smoothing, Solver, Sym2};

use crate::places::Place;

const EXAMPLES: &str = "\
Examples:
  ridgeway info valley.tif
  ridgeway route valley.tif --start 388400,4711200 --goal lonlat:1.62,42.57 -o route.geojson -o route.gpx
  ridgeway compare valley.tif --start pixel:40,60 --goal pixel:300,210 -o comparison

Places (--start, --goal):
  X,Y                map coordinates of the DEM
  lonlat:LON,LAT     longitude and latitude in degrees, WGS84
  pixel:COL,ROW      cells from the north-west corner; 0,0 is the centre of the first one
  FILE.geojson       points; for --start also lines and areas, every point of which is a start

Exit codes: 0 done, 1 no way between start and goal, 2 wrong use or bad input, 3 reading or writing
failed, 130 cancelled.";

/// Plans routes over terrain by anisotropic geodesic distance.
///
/// A DEM becomes a smooth surface, the surface's curvature a metric, the metric a distance map, and
/// the distance map routes that follow the valleys and ridges of the ground.
#[derive(Debug, Parser)]
#[command(name = "ridgeway", version, after_help = EXAMPLES, max_term_width = 100)]
pub(crate) struct Cli {
    #[command(subcommand)]
    pub(crate) command: Command,
    #[command(flatten)]
    pub(crate) run: RunArgs,
}

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Say what a DEM holds: size, cells, CRS, units, voids, heights, and what would be fitted.
    Info(InfoArgs),
    /// Make a synthetic terrain.
    Synth(SynthArgs),
    /// Fit the surface, report its residuals, write heights, slope and curvatures.
    Surface(SurfaceArgs),
    /// Compute the distance from the start at every cell.
    Distance(DistanceArgs),
    /// Plan the route from the start to each goal.
    Route(RouteArgs),
    /// Plan one route under several metrics and measure each under all of them.
    Compare(CompareArgs),
    /// Cut the terrain into regions of like shape; their borders tend to lie on ridges and valleys.
    Segment(SegmentArgs),
    /// Find regions of like shape on two surfaces, or on one.
    Match(MatchArgs),
    /// Draw a map of a DEM, with routes if asked.
    Render(RenderArgs),
    /// Print a completion script for a shell.
    #[command(hide = true)]
    Completions {
        /// The shell.
        shell: clap_complete::Shell,
    },
    /// Print the manual page.
    #[command(hide = true)]
    Man,
}

/// How to run: the same for every command.
#[derive(Debug, Args)]
#[command(next_help_heading = "Running")]
pub(crate) struct RunArgs {
    /// Say nothing but errors and what --json asks for.
    #[arg(short, long, global = true, conflicts_with = "progress")]
    pub(crate) quiet: bool,
    /// Show progress at once (else after a second, and on a terminal only).
    #[arg(long, global = true)]
    pub(crate) progress: bool,
    /// Print JSON for machines instead of text for people.
    #[arg(long, global = true)]
    pub(crate) json: bool,
    /// Number of threads; no result depends on it [default: all processors].
    #[arg(long, global = true, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub(crate) threads: Option<u16>,
}

#[derive(Debug, Args)]
pub(crate) struct InfoArgs {
    /// The DEM.
    pub(crate) dem: PathBuf,
    #[command(flatten)]
    pub(crate) fit: FitArgs,
}

#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  ridgeway synth --list
  ridgeway synth range --size 301x201 --spacing 30 --seed 7 --crs EPSG:32632 -o range.tif")]
pub(crate) struct SynthArgs {
    /// The kind of terrain; --list names them.
    #[arg(required_unless_present = "list")]
    pub(crate) kind: Option<String>,
    /// List the kinds.
    #[arg(long)]
    pub(crate) list: bool,
    /// The GeoTIFF to write.
    #[arg(short, long, value_name = "FILE.tif", required_unless_present = "list")]
    pub(crate) output: Option<PathBuf>,
    /// Replace the file if it exists.
    #[arg(long)]
    pub(crate) overwrite: bool,
    /// Columns and rows.
    #[arg(long, value_name = "COLSxROWS", default_value = "301x301", value_parser = size)]
    pub(crate) size: (usize, usize),
    /// Cell size in metres.
    #[arg(long, value_name = "M", default_value = "30", value_parser = positive, allow_hyphen_values = true)]
    pub(crate) spacing: f64,
    /// Seed of the random kinds.
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub(crate) seed: u64,
    /// Height between the lowest and the highest ground in metres, roughly [default: by kind].
    #[arg(long, value_name = "M", value_parser = positive, allow_hyphen_values = true)]
    pub(crate) relief: Option<f64>,
    /// The CRS; a projected one [default: none].
    #[arg(long, value_name = "EPSG:N", value_parser = epsg)]
    pub(crate) crs: Option<u32>,
    /// Map coordinates of the centre of the south-west cell.
    #[arg(long, value_name = "X,Y", default_value = "0,0", value_parser = pair, allow_hyphen_values = true)]
    pub(crate) origin: DVec2,
}

#[derive(Debug, Args)]
#[command(after_help = "\
Example:
  ridgeway surface valley.tif --layers height,slope,mean -o valley-surface.tif")]
pub(crate) struct SurfaceArgs {
    /// The DEM.
    pub(crate) dem: PathBuf,
    /// The GeoTIFF to write, a band per layer; without it only the residuals are reported.
    #[arg(short, long, value_name = "FILE.tif")]
    pub(crate) output: Option<PathBuf>,
    /// Replace the file if it exists.
    #[arg(long)]
    pub(crate) overwrite: bool,
    /// What to write: heights in m, slope in degrees, curvatures in 1/m (Gaussian in 1/m²); a
    /// curvature is positive where the ground is hollow.
    #[arg(long, value_enum, value_delimiter = ',', default_values = ["height"])]
    pub(crate) layers: Vec<Layer>,
    #[command(flatten)]
    pub(crate) fit: FitArgs,
}

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
    #[arg(long, value_name = "PLACE", allow_hyphen_values = true)]
    pub(crate) goal: Vec<Place>,
    /// The metric [default: curvature, or tensor with --tensor].
    #[arg(long, value_parser = metric(), value_name = "METRIC")]
    pub(crate) metric: Option<NamedMetric>,
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
    #[arg(long, value_name = "PLACE", required = true, allow_hyphen_values = true)]
    pub(crate) goal: Vec<Place>,
    /// The metric [default: curvature, or tensor with --tensor].
    #[arg(long, value_parser = metric(), value_name = "METRIC")]
    pub(crate) metric: Option<NamedMetric>,
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
    #[arg(long, value_name = "PLACE", allow_hyphen_values = true)]
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
    /// The metric [default: curvature, or tensor with --tensor].
    #[arg(long, value_parser = metric(), value_name = "METRIC")]
    pub(crate) metric: Option<NamedMetric>,
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
    /// The metric of the regions [default: curvature, or tensor with --tensor].
    #[arg(long, value_parser = metric(), value_name = "METRIC")]
    pub(crate) metric: Option<NamedMetric>,
    /// Let sizes count beside shapes.
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

#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  ridgeway render valley.tif -o valley.png
  ridgeway render valley.tif --layer mean -o curvature.png
  ridgeway render valley.tif --start pixel:40,60 --goal pixel:300,210 -o route.png")]
pub(crate) struct RenderArgs {
    /// The DEM.
    pub(crate) dem: PathBuf,
    /// The picture to write.
    #[arg(short, long, value_name = "FILE.png")]
    pub(crate) output: PathBuf,
    /// Replace the file if it exists.
    #[arg(long)]
    pub(crate) overwrite: bool,
    /// The ground to draw.
    #[arg(long, value_enum, default_value_t = Picture::Hillshade)]
    pub(crate) layer: Picture,
    /// Length of the longer side in pixels.
    #[arg(long, value_name = "PIXELS", default_value_t = 1600, value_parser = clap::value_parser!(u32).range(100..=8192))]
    pub(crate) width: u32,
    /// Draw routes from here.
    #[arg(long, value_name = "PLACE", requires = "goal", allow_hyphen_values = true)]
    pub(crate) start: Vec<Place>,
    /// Draw routes to here; may be given several times.
    #[arg(long, value_name = "PLACE", requires = "start", allow_hyphen_values = true)]
    pub(crate) goal: Vec<Place>,
    /// The metric of the routes [default: curvature, or tensor with --tensor].
    #[arg(long, value_parser = metric(), value_name = "METRIC")]
    pub(crate) metric: Option<NamedMetric>,
    #[command(flatten)]
    pub(crate) ground: GroundArgs,
}

/// Where distance is zero.
#[derive(Debug, Args)]
pub(crate) struct StartArgs {
    /// Where to start; may be given several times: the nearest start counts.
    #[arg(long, value_name = "PLACE", required = true, allow_hyphen_values = true)]
    pub(crate) start: Vec<Place>,
}

/// The surface and the metric on it.
#[derive(Debug, Args)]
pub(crate) struct GroundArgs {
    #[command(flatten)]
    pub(crate) fit: FitArgs,
    #[command(flatten)]
    pub(crate) metric: MetricArgs,
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

/// What surface to fit.
#[derive(Debug, Args)]
#[command(next_help_heading = "Surface")]
pub(crate) struct FitArgs {
    /// Degree of the B-spline.
    #[arg(long, value_enum, default_value_t = DegreeName::Cubic)]
    pub(crate) degree: DegreeName,
    #[arg(
        long,
        value_name = "METRES",
        value_parser = smoothing,
        allow_hyphen_values = true,
        help = format!(
            "Cut-off wavelength: metres, a number of cells such as 16cells, auto (cross-validation), \
             or 0 to go through every height [default: {}cells]",
            FitOptions::DEFAULT_CUTOFF_CELLS
        )
    )]
    pub(crate) smooth: Option<Smoothing>,
    /// As few knots as keep the root-mean-square residual under this many metres.
    #[arg(long, value_name = "M", conflicts_with = "smooth", value_parser = positive, allow_hyphen_values = true)]
    pub(crate) tolerance: Option<f64>,
}

impl FitArgs {
    pub(crate) fn options(&self) -> FitOptions {
        let smoothing = match (self.tolerance, self.smooth) {
            (Some(tolerance), _) => Smoothing::Tolerance(tolerance),
            (None, Some(smoothing)) => smoothing,
            (None, None) => FitOptions::default().smoothing,
        };
        let degree = match self.degree {
            DegreeName::Cubic => Degree::Cubic,
            DegreeName::Quintic => Degree::Quintic,
        };
        FitOptions { degree, smoothing }
    }
}

/// A flag's value, `None` for `auto`. Called `Option`, clap would take it for a flag that may be left out.
pub(crate) type OrAuto<T> = Option<T>;

/// What a metric needs to know, and what composes with all of them.
#[derive(Debug, Args)]
#[command(next_help_heading = "Metric")]
pub(crate) struct MetricArgs {
    /// How much straight, uncurved ground costs beside curved: `auto` (a tenth of the
    /// root-mean-square curvature; all of it in the curvature tensors that the difference metrics compare), `auto:SHARE`, or a
    /// curvature in 1/m.
    #[arg(long, value_name = "1/M", default_value = "auto", value_parser = delta, allow_hyphen_values = true)]
    pub(crate) delta: OrAuto<Delta>,
    /// How much ground of even shape costs beside ground where the curvature changes, on the difference metrics: `auto` (the
    /// square of the mean rate of change), `auto:SHARE` of it, or a number in their own unit (none; m² if literal).
    #[arg(long, value_name = "VALUE", default_value = "auto", value_parser = difference_delta, allow_hyphen_values = true)]
    pub(crate) difference_delta: OrAuto<Delta>,
    /// Aversion to grade: β of the term β∇z∇zᵀ added to the metric.
    ///
    /// On the isotropic metric going up or down a grade s costs √(1 + s² + βs²) per plan metre: with
    /// 100 a grade of 10 % costs 1.4 times as much as level ground. On the curvature metric level,
    /// straight ground costs √δ, so the same aversion takes 100 δ. With more than 1000, or 1000 δ,
    /// distances come out far too short.
    #[arg(long, value_name = "BETA", default_value = "0", value_parser = not_negative, allow_hyphen_values = true)]
    pub(crate) climb_weight: f64,
    /// Ground steeper than this many degrees may not be entered.
    #[arg(long, value_name = "DEG", value_parser = slope, allow_hyphen_values = true)]
    pub(crate) max_slope: Option<f64>,
    /// Lines and areas (GeoJSON) that may not be crossed; may be given several times.
    #[arg(long, value_name = "FILE.geojson")]
    pub(crate) barrier: Vec<PathBuf>,
    /// What the ground costs: a raster on the DEM's grid with a factor above 0 on the length of every step,
    /// the largest at most 1000 times the smallest; cells without a value may not be entered.
    #[arg(long, value_name = "FILE.tif")]
    pub(crate) cost: Option<PathBuf>,
    /// Your own speed tensors: a float raster on the DEM's grid with bands D11, D12, D22, x east, y north.
    #[arg(long, value_name = "FILE.tif")]
    pub(crate) tensor: Option<PathBuf>,
    /// How exactly to solve: `high` is of second order in the cell size and takes 2.3 to 3.4 times as long in the solver.
    #[arg(long, value_enum, value_name = "HOW", default_value_t = AccuracyName::Fast)]
    pub(crate) accuracy: AccuracyName,
}

impl MetricArgs {
    pub(crate) fn solver(&self) -> Solver {
        let accuracy = match self.accuracy {
            AccuracyName::Fast => Accuracy::Fast,
            AccuracyName::High => Accuracy::High,
        };
        Solver { accuracy, ..Solver::default() }
    }

    /// The metric to use where the user asks for `asked`.
    ///
    /// # Errors
    /// As [`check_tensor`](Self::check_tensor).
    pub(crate) fn chosen(&self, asked: Option<NamedMetric>) -> Result<NamedMetric, Error> {
        let metric = asked.unwrap_or(self.default_metric());
        self.check_tensor(&[metric])?;
        Ok(metric)
    }

    /// The metric that a user who names none wants.
    pub(crate) fn default_metric(&self) -> NamedMetric {
        known(if self.tensor.is_some() { TENSOR } else { CURVATURE })
    }

    /// # Errors
    /// `--tensor` beside metrics that do not look at it.
    pub(crate) fn check_tensor(&self, metrics: &[NamedMetric]) -> Result<(), Error> {
        if self.tensor.is_some() && !metrics.iter().any(|metric| metric.name == TENSOR) {
            return Err(Error::usage(
                "--tensor is used by the metric `tensor` alone, which is not asked for; name it, or leave --tensor out",
            ));
        }
        Ok(())
    }

    /// The metric of this name, with the user's tensors if there are any.
    ///
    /// # Errors
    /// `tensor` without tensors.
    pub(crate) fn metric(
        &self,
        metric: NamedMetric,
        tensors: Option<&Arc<[Sym2]>>,
    ) -> Result<Box<dyn Metric>, Error> {
        if metric.name == TENSOR && tensors.is_none() {
            return Err(Error::usage("the metric `tensor` needs --tensor FILE.tif"));
        }
        metric.with(&MetricOptions {
            delta: self.delta,
            difference_delta: self.difference_delta,
            tensors: tensors.cloned(),
        })
    }

    /// The first flag given that only a DEM can have.
    pub(crate) fn of_dems(&self) -> Option<&'static str> {
        let given = [
            ("--climb-weight", self.climb_weight > 0.0),
            ("--max-slope", self.max_slope.is_some()),
            ("--barrier", !self.barrier.is_empty()),
            ("--cost", self.cost.is_some()),
            ("--tensor", self.tensor.is_some()),
        ];
        given.into_iter().find_map(|(flag, given)| given.then_some(flag))
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum AccuracyName {
    /// First order.
    Fast,
    /// Second order, with an estimate of the error.
    High,
}

impl AccuracyName {
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Fast => "fast",
            Self::High => "high",
        }
    }
}

/// The metric of `--tensor`.
pub(crate) const TENSOR: &str = "tensor";
/// The metric of a user who names none.
pub(crate) const CURVATURE: &str = "curvature";

/// The metric of a name that is known to be one.
pub(crate) fn known(name: &str) -> NamedMetric {
    NamedMetric::find(name).expect("the library has it")
}

/// Takes the name of a metric.
fn metric() -> impl TypedValueParser<Value = NamedMetric> {
    let names = NAMED.map(|metric| PossibleValue::new(metric.name).help(metric.about));
    PossibleValuesParser::new(names).map(|name| known(&name))
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum DegreeName {
    /// Continuous curvature.
    Cubic,
    /// Continuous fourth derivatives.
    Quintic,
}

impl DegreeName {
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Cubic => "cubic",
            Self::Quintic => "quintic",
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Layer {
    /// Height, m.
    Height,
    /// Slope, degrees.
    Slope,
    /// Gaussian curvature, 1/m².
    Gaussian,
    /// Mean curvature, 1/m.
    Mean,
    /// Larger principal curvature, 1/m.
    K1,
    /// Smaller principal curvature, 1/m.
    K2,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Picture {
    /// Shaded relief.
    Hillshade,
    /// Height, m.
    Height,
    /// Slope, degrees.
    Slope,
    /// Mean curvature, 1/m.
    Mean,
    /// Gaussian curvature, 1/m².
    Gaussian,
}

/// Two finite numbers `X,Y`.
pub(crate) fn pair(text: &str) -> Result<DVec2, String> {
    let number = |part: &str| part.trim().parse::<f64>().ok().filter(|v| v.is_finite());
    text.split_once(',')
        .and_then(|(x, y)| Some(DVec2::new(number(x)?, number(y)?)))
        .ok_or_else(|| "expected two numbers, for example 388400,4711200".into())
}

fn number(text: &str, good: impl Fn(f64) -> bool, expected: &str) -> Result<f64, String> {
    match text.trim().parse() {
        Ok(value) if f64::is_finite(value) && good(value) => Ok(value),
        _ => Err(format!("expected {expected}")),
    }
}

fn positive(text: &str) -> Result<f64, String> {
    number(text, |v| v > 0.0, "a number above 0")
}

fn not_negative(text: &str) -> Result<f64, String> {
    number(text, |v| v >= 0.0, "a number, 0 or more")
}

fn share(text: &str) -> Result<f64, String> {
    number(text, |v| (0.0..=1.0).contains(&v), "a number between 0 and 1")
}

fn slope(text: &str) -> Result<f64, String> {
    number(text, |v| v > 0.0 && v <= 90.0, "an angle above 0 and up to 90 degrees")
}

/// Most cells of a synthetic terrain: 2 GB of heights.
const MOST_CELLS: usize = 1 << 28;

fn size(text: &str) -> Result<(usize, usize), String> {
    let count = |part: &str| part.trim().parse::<usize>().ok().filter(|&n| n > 0);
    text.split_once(['x', 'X', '×'])
        .and_then(|(cols, rows)| Some((count(cols)?, count(rows)?)))
        .filter(|(cols, rows)| cols.checked_mul(*rows).is_some_and(|cells| cells <= MOST_CELLS))
        .ok_or_else(|| {
            format!(
                "expected columns and rows, for example 301x201, and at most {MOST_CELLS} cells"
            )
        })
}

fn epsg(text: &str) -> Result<u32, String> {
    let code = match text.split_at_checked(5) {
        Some((prefix, code)) if prefix.eq_ignore_ascii_case("epsg:") => code,
        _ => text,
    };
    code.parse().map_err(|_| "expected an EPSG code, for example EPSG:32631".into())
}

fn smoothing(text: &str) -> Result<Smoothing, String> {
    const EXPECTED: &str = "a length in metres, a number of cells such as 16cells, auto, or 0";
    if text == "auto" {
        return Ok(Smoothing::Auto);
    }
    if let Some(cells) = text.strip_suffix("cells") {
        return number(cells, |v| v > 0.0, EXPECTED).map(Smoothing::CutoffCells);
    }
    let metres = number(text.strip_suffix('m').unwrap_or(text), |v| v >= 0.0, EXPECTED)?;
    Ok(if metres == 0.0 { Smoothing::Interpolate } else { Smoothing::Cutoff(metres) })
}

fn delta(text: &str) -> Result<OrAuto<Delta>, String> {
    auto_or(text, "auto, auto:SHARE, or a curvature above 0 in 1/m such as 0.001")
}

fn difference_delta(text: &str) -> Result<OrAuto<Delta>, String> {
    auto_or(text, "auto, auto:SHARE, or a number above 0")
}

fn auto_or(text: &str, expected: &str) -> Result<OrAuto<Delta>, String> {
    let positive = |text| number(text, |v| v > 0.0, expected);
    match text.strip_prefix("auto") {
        Some("") => Ok(None),
        Some(share) => positive(share.strip_prefix(':').unwrap_or("")).map(Delta::Auto).map(Some),
        None => positive(text).map(Delta::Absolute).map(Some),
    }
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use super::*;

    #[test]
    fn definitions_are_consistent() {
        Cli::command().debug_assert();
    }

    #[test]
    fn values_with_units_parse() {
        assert_eq!(smoothing("0"), Ok(Smoothing::Interpolate));
        assert_eq!(smoothing("16cells"), Ok(Smoothing::CutoffCells(16.0)));
        assert_eq!(smoothing("480m"), Ok(Smoothing::Cutoff(480.0)));
        assert_eq!(smoothing("auto"), Ok(Smoothing::Auto));
        assert!(
            smoothing("-3").is_err() && smoothing("cells").is_err() && smoothing("NaN").is_err()
        );
        assert_eq!(delta("auto"), Ok(None));
        assert_eq!(delta("auto:0.05"), Ok(Some(Delta::Auto(0.05))));
        assert_eq!(delta("1e-3"), Ok(Some(Delta::Absolute(1e-3))));
        assert!(delta("0").is_err() && delta("autos").is_err() && delta("inf").is_err());
        assert_eq!(size("30x20"), Ok((30, 20)));
        assert!(size("30").is_err() && size("0x3").is_err() && size("-1x3").is_err());
        assert_eq!(epsg("EPSG:32631"), Ok(32631));
        assert_eq!(epsg("32631"), Ok(32631));
        assert!(epsg("EPSG:").is_err() && epsg("äöü").is_err());
    }

    #[test]
    fn negative_coordinates_parse() {
        let cli = Cli::try_parse_from([
            "ridgeway",
            "route",
            "a.tif",
            "--start",
            "-1.5,-2",
            "--goal=-3,4",
        ]);
        let Command::Route(route) = cli.unwrap().command else { panic!() };
        assert_eq!(route.start.start, ["-1.5,-2".parse().unwrap()]);
    }
}
