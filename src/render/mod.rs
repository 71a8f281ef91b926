//! Pictures: maps of routes, isolines and regions over shaded terrain, and fields in colour.
//!
//! A [`SurfacePicture`] shows a surface in space. A map is laid out below its title in its true
//! proportions on the ground, above the scale bar and the legend, which therefore never cover it.

mod camera;
mod canvas;
mod colour;
mod depth_buffer;
mod field;
mod gradient;
mod isolines;
mod layout;
mod legend;
mod map;
mod palette;
mod plot;
mod png;
mod region_numbers;
mod regions;
mod relief;
mod surface;
mod symbol;
mod text;

pub use self::colour::Rgb;
pub use self::field::FieldPicture;
pub use self::gradient::Gradient;
pub use self::isolines::IsolineLayer;
pub use self::map::{MapPicture, RouteLayer};
pub use self::palette::{contrasting_colours, pair_colour};
pub use self::plot::{LogPlot, Mark};
pub use self::png::encode_png;
pub use self::regions::RegionLayer;
pub use self::surface::{SurfacePicture, side_by_side};
