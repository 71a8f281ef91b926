//! Routes and rasters for other programs.
