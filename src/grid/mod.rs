//! Grids: where nodes lie, and what geometry touches them.

mod frame;
mod isolines;
pub(crate) mod tiling;

pub use self::frame::{GridFrame, Ground};
pub use self::isolines::{Isoline, isolines, levels_by_step, round_step};
