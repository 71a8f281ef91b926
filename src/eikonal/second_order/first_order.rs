//! What the correction starts from.

use super::super::factors::Factors;
use super::super::schedule::values::Values;
use super::super::source::Seeds;
use super::super::stencil::UNREACHED;
use super::super::tensor_field::TensorField;
use crate::grid::tiling::AREA;

/// The first-order solution that is to be corrected.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FirstOrder<'a> {
    pub(crate) field: &'a TensorField,
    pub(crate) factors: &'a Factors,
    pub(crate) values: &'a Values,
    pub(crate) seeds: &'a [Option<Box<Seeds>>],
}

impl FirstOrder<'_> {
    /// The places of a tile that have nothing to correct: the start, and what is closed or not reached.
    pub(super) fn fixed(&self, tile: usize) -> impl Iterator<Item = usize> {
        let (values, seeds) = (self.values.tile(tile), self.seeds[tile].as_deref());
        let is_start = move |i: usize| seeds.is_some_and(|seeds| seeds[i] < UNREACHED);
        (0..AREA).filter(move |&i| values[i] >= UNREACHED || is_start(i))
    }
}
