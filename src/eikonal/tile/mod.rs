//! Solving a tile: a pure function of its tensors, the values in it and around it, and the start values.
//!
//! Nothing here knows where tiles are stored or when they are solved. [`kernel::solve`] is given the equation ([`Tile`]) and which
//! neighbours have changes; it returns values, the changes that could improve each neighbour, and [`Limits`].

pub(crate) mod changes;
pub(crate) mod coefficients;
pub(crate) mod kernel;
pub(crate) mod transpose;

use glam::DVec2;

use super::source::Seeds;
use super::stencil::factoring::Factor;
use super::tensor_field::StepPrices;
use crate::grid::tiling::SIDE;

/// A set of rows or of columns of a tile, one bit each.
pub(crate) type LineMask = u32;

/// All rows of a tile.
pub(crate) const ALL: LineMask = (1 << SIDE) - 1;

/// The discrete equation on a tile.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Tile<'a> {
    /// What steps in it cost.
    pub(crate) prices: StepPrices<'a>,
    /// The factor that may apply in the tile, and the tile's first node.
    pub(crate) factor: Option<(&'a Factor, DVec2)>,
    /// A change below this share of a node's shortest step does not count.
    pub(crate) tolerance: f32,
    /// Values from the start.
    pub(crate) seeds: Option<&'a Seeds>,
}

/// What is known of the updated nodes of a tile.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Limits {
    /// The causality margin: by how much the value of a neighbour may exceed that of a node and still improve it. The minimum over a segment
    /// exceeds the values at both ends unless the directions to them make an obtuse angle under `M`; then it may lie below that at
    /// one end `a` by up to `−aᵀMb/‖b‖`. Source factoring adds to the margin by lowering the neighbours' values.
    pub(crate) margin: f32,
    /// The longest step of any node.
    pub(crate) longest_step: f32,
}
