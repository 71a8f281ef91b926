//! Distances: `√(∇gᵀ D ∇g) = 1`, `g = 0` on the start region.
//!
//! [`Solver::solve`] discretises the equation by the semi-Lagrangian update on the eight triangles around a node
//! (`stencil/`) and iterates it until it converges, tile by tile (`tile/`), in order of distance (`schedule/`). First order
//! in the spacing, also near the start, where source factoring removes the singularity (`stencil/factoring.rs`); second order by deferred
//! correction if asked for ([`Accuracy`], `second_order/`). Walls one node thick do not leak, also diagonally. Cost: 30 to 60
//! ns of one core and 16 to 40 bytes per node, at high accuracy 80 to 150 ns and 8 more. [`mod@reference`] is the
//! slow solver that tests compare with; `docs/solver.md` has the measurements.

mod allocation;
mod ball;
mod cell;
mod distance_map;
mod factors;
mod incremental;
mod interpolation;
mod predecessor;
pub mod reference;
mod schedule;
mod second_order;
mod solver;
mod source;
mod start;
mod stencil;
mod tensor_field;
mod tile;

pub(crate) use self::ball::Balls;
pub use self::distance_map::DistanceMap;
pub use self::schedule::rounds::Statistics;
pub use self::schedule::stop::Stop;
pub use self::solver::{Accuracy, Solver};
pub(crate) use self::source::has_line_of_sight;
pub use self::start::StartRegion;
pub use self::tensor_field::TensorField;

#[cfg(test)]
mod tests;
