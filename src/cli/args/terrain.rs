//! Flags of the commands about one terrain: `info`, `synth`, `surface`.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use glam::DVec2;

use super::ground::FitArgs;
use super::values::{epsg, pair, positive, size};

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
