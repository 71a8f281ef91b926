//! Flags of `render`.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use ridgeway::metric::NamedMetric;
use ridgeway::plan::Place;

use super::ground::{GroundArgs, metric};
use super::values::place;

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
    #[arg(long, value_name = "PLACE", value_parser = place, requires = "goal", allow_hyphen_values = true)]
    pub(crate) start: Vec<Place>,
    /// Draw routes to here; may be given several times.
    #[arg(long, value_name = "PLACE", value_parser = place, requires = "start", allow_hyphen_values = true)]
    pub(crate) goal: Vec<Place>,
    /// The metric of the routes [default: curvature, or tensor with --tensor].
    #[arg(long, value_parser = metric(), value_name = "METRIC")]
    pub(crate) metric: Option<NamedMetric>,
    #[command(flatten)]
    pub(crate) ground: GroundArgs,
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
