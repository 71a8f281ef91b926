//! Grids: where nodes lie, how they are cut into tiles, and which of them geometry touches.

mod frame;
mod isolines;
mod line_of_sight;
mod rasterise;
mod shapes;
pub(crate) mod tiling;

pub use self::frame::{GridFrame, Ground};
pub use self::isolines::{Isoline, isolines, levels_by_step, round_step};
pub(crate) use self::line_of_sight::in_sight;
pub use self::rasterise::rasterise;
pub use self::shapes::Shapes;
pub(crate) use self::shapes::{contains, nodes_inside};
