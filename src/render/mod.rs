//! Pictures: maps of routes and isolines over shaded terrain, and fields in colour.
//!
//! A picture is a sheet: a title, the map in its true proportions on the ground, and below it the
//! scale bar and the legend, which therefore never cover the map.

mod canvas;
mod field;
mod map;
mod relief;
mod sheet;
mod text;

pub use self::canvas::Rgb;
pub use self::field::{FieldPicture, Gradient};
pub use self::map::{IsolineLayer, MapPicture, RouteLayer};
