//! Tensor-product B-splines: least squares along rows and then columns.
//!
//! [`basis`] has the splines of one axis, [`banded`] the solver, [`fit`] the fit and its derivatives, [`voids`] the fit
//! around voids, [`domain`] where it has knots, [`continuation`] the ground in its margin, [`knots`] knots and smoothing, [`selection`] their choice by the data; [`block`] evaluates many nodes
//! at once, [`residuals`] says how well a surface fits.

pub(in crate::surface) mod banded;
pub(in crate::surface) mod basis;
pub(in crate::surface) mod block;
pub(in crate::surface) mod continuation;
pub(in crate::surface) mod domain;
pub(in crate::surface) mod fit;
pub(in crate::surface) mod knots;
pub(in crate::surface) mod residuals;
pub(in crate::surface) mod selection;
pub(in crate::surface) mod voids;
