//! Heights become a smooth map with exact derivatives.

mod height;

pub use self::height::{Degree, FitOptions, HeightJet, HeightSurface, Residuals, Smoothing};
