//! The command line as the user writes it: flags, their help and their parsers. No file is touched here.

mod ground;
mod regions;
mod render;
mod routing;
mod terrain;
mod values;

use clap::{Args, Parser, Subcommand};

pub(crate) use self::ground::{AccuracyName, CURVATURE, FitArgs, GroundArgs, metric_named};
pub(crate) use self::regions::{MatchArgs, RegionArgs, SegmentArgs};
pub(crate) use self::render::{Picture, RenderArgs};
pub(crate) use self::routing::{CompareArgs, DistanceArgs, RouteArgs};
pub(crate) use self::terrain::{InfoArgs, Layer, SurfaceArgs, SynthArgs};

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

Exit codes: 0 done, 1 no path between start and goal, 2 wrong use or bad input, 3 reading or writing
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

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use super::*;

    #[test]
    fn definitions_are_consistent() {
        Cli::command().debug_assert();
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
