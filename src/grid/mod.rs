//! Grids: where nodes lie, and what geometry touches them.

mod frame;

pub use self::frame::{GridFrame, Ground};
