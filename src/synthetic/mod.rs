//! Terrains made from a formula: derivatives known exactly, distances too where geometry allows.
//!
//! Every kind is one smooth function of `(x, y)`, metres east and north of the **centre** of the grid,
//! and fills the grid whatever its size: `a`, half the longer side, is the unit of its horizontal shape,
//! and [`relief`](Synthetic::with_relief) that of its vertical shape. The same kind, seed, extent and
//! relief at a finer spacing is the same terrain; the noisy ones gain detail down to four cells.
//!
//! A new kind is a file with these that holds its shape, and a line in the list of `kind.rs`.
//!
//! Heights have the same bits on every run, thread count and platform.
//!
//! ```
//! use ridgeway::synthetic::{Synthetic, SyntheticKind};
//!
//! # fn main() -> ridgeway::Result<()> {
//! let trough = Synthetic::new(SyntheticKind::Cylinder, 201, 101, 10.0)?;
//! assert_eq!(trough.heights().len(), 201 * 101);
//! assert_eq!(trough.jet(0.0, 0.0).zxx, 1.0 / trough.radius().unwrap());
//! # Ok(())
//! # }
//! ```

mod cone;
mod craters;
mod fractal;
mod hills;
mod kind;
mod noise;
mod plane;
mod range;
mod round;
mod scalar;
mod shape;
mod switchbacks;
#[expect(clippy::module_inception, reason = "the folder is named after its main type")]
mod synthetic;

pub use self::kind::SyntheticKind;
pub use self::round::{cylinder_distance, sphere_distance};
pub use self::synthetic::Synthetic;
