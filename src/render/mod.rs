//! Pictures: maps of routes, isolines and regions over shaded terrain, and fields in colour.
//!
//! A [`SurfacePicture`] shows a surface in space. A map is laid out below its title in its true
//! proportions on the ground, above the scale bar and the legend, which therefore never cover it.

mod canvas;
mod field;
mod layout;
mod map;
mod plot;
mod png;
mod regions;
mod relief;
mod surface;
mod text;

pub use self::canvas::Rgb;
pub use self::field::{FieldPicture, Gradient};
pub use self::map::{IsolineLayer, MapPicture, RouteLayer};
pub use self::plot::{LogPlot, Mark, pair_colour};
pub use self::png::encode_png;
pub use self::regions::{RegionLayer, contrasting_colours};
pub use self::surface::{SurfacePicture, beside};
