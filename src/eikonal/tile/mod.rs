//! Solving a tile: a pure function of its tensors, the values in and around it, and the start values.
//!
//! Nothing here knows where tiles are stored or when they are solved. [`kernel::solve`] is given what the equation needs
//! ([`Tile`]) and which neighbours have changes, and returns values, what could improve each neighbour, and [`Limits`].

pub(crate) mod changes;
pub(crate) mod coefficients;
pub(crate) mod kernel;
pub(crate) mod transpose;

use glam::DVec2;

use super::cone::Cone;
use super::field::{SIDE, TensorTile};
use super::source::Seeds;

/// Side of a block: a tile and one node of each neighbour around it, its halo.
pub(crate) const BLOCK: usize = SIDE + 2;

/// Values of a tile and of its halo, row by row, each `(column, row)` from −1 to 16.
pub(crate) type Block = [[f32; BLOCK]; BLOCK];

/// A set of rows or of columns of a tile, one bit each.
pub(crate) type Lines = u32;

/// All rows of a tile.
pub(crate) const ALL: Lines = (1 << SIDE) - 1;

/// The discrete equation on a tile.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Tile<'a> {
    pub(crate) tensors: &'a TensorTile,
    /// Cone that the tile lies in, and the tile's first node.
    pub(crate) cone: Option<(&'a Cone, DVec2)>,
    /// A change below this share of a node's shortest step does not count.
    pub(crate) tolerance: f32,
    pub(crate) seeds: Option<&'a Seeds>,
}

/// What a sweep does to a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Rule {
    /// Lowers it to its best value over the ring.
    Lower,
    /// Makes it unreached if its ring no longer supports its value: if the best value over the ring is higher.
    Forget,
}

/// What is known of the updated nodes of a tile.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Limits {
    /// By how much the value of a neighbour may exceed that of a node and still improve it. A node's least over a segment
    /// is above both ends unless the directions to them make an obtuse angle under `M`; then it may lie below
    /// one end `a` by up to `−aᵀMb/‖b‖`. A cone lowers the neighbours' values besides.
    pub(crate) slack: f32,
    /// The longest step of any node.
    pub(crate) longest_step: f32,
}
