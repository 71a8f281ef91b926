//! Coordinate reference systems: which one a file is in, and how it leads to longitude and latitude.
//!
//! Projections are those of [`proj4rs`], definitions those of [`crs_definitions`] (the EPSG data set in PROJ.4
//! notation), and well-known text is understood by [`proj4wkt`]. Datum shifts are three- or seven-parameter ones; shift grids are not included, and where that
//! matters [`Crs::caveat`] says how much.

#[expect(clippy::module_inception, reason = "the folder is named after its main type")]
mod crs;
mod datum_shift;
mod epsg_names;
mod from_arc_info;
mod from_geo_keys;
mod from_wkt;
mod geo_keys;
mod units;
mod wkt;

pub use self::crs::Crs;
pub(crate) use self::geo_keys::GeoKeys;
pub(super) use self::geo_keys::key;
pub(super) use self::units::length_unit;
