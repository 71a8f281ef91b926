//! The stencil: a node, the ring of its neighbours, and the eight triangles between them.

pub(crate) mod factoring;
pub(crate) mod foot;
pub(crate) mod ring;
pub(crate) mod segment;

/// Value of a node that no front has reached. Far above any distance, and its square still a finite `f32`.
pub(crate) const UNREACHED: f32 = 1e18;
