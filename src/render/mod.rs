//! Pictures: maps of routes, isolines and regions over shaded terrain, and fields in colour.
//!
//! A [`SurfacePicture`] shows a surface in space. Any other picture is a sheet: a title, the map in its true proportions on the ground, and below it the
//! scale bar and the legend, which therefore never cover the map.

mod canvas;
mod field;
mod map;
mod plot;
mod regions;
mod relief;
mod sheet;
mod surface;
mod text;

pub use self::canvas::{Rgb, png};
pub use self::field::{FieldPicture, Gradient};
pub use self::map::{IsolineLayer, MapPicture, RouteLayer};
pub use self::plot::{LogPlot, Mark, pair_colour};
pub use self::regions::{RegionLayer, contrasting_colours};
pub use self::surface::{SurfacePicture, beside};
