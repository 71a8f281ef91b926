//! The offset `δ` that is added to curvatures.

use crate::error::{Error, Result};
use crate::surface::{Measures, Surface};

/// A surface that bends by no more than this, as curvature times extent, counts as a plane. A plane of 4000² cells of 30 m with
/// heights in `f32` bends by 5e-4 when fitted by the defaults, all of it rounding.
pub(crate) const PLANE_BEND: f64 = 1e-3;

/// The offset `δ` of the curvature tensor, 1/m. A step along a principal direction costs `√(δ + |κ|)` per metre, so the smaller `δ`
/// is, the cheaper are flat directions compared with curved ones.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Delta {
    /// This share of the root-mean-square curvature of the surface. Scaling a terrain then scales `D` by a
    /// constant and changes no route. On a plane `1/extent` instead, both from [`Surface::measures`]: any `δ` gives the same routes there.
    /// A surface that bends by less than 1e-3 over its extent counts as a plane: heights in `f32` do not resolve less.
    Auto(f64),
    /// An absolute curvature in 1/m.
    Absolute(f64),
}

impl Delta {
    /// Default share of the root-mean-square curvature.
    pub const DEFAULT_SHARE: f64 = 0.1;

    /// The share or the curvature, checked.
    ///
    /// # Errors
    /// It is not positive and finite.
    pub(super) fn number(self) -> Result<f64> {
        let (value, what) = match self {
            Self::Absolute(delta) => (delta, "the offset delta"),
            Self::Auto(share) => (share, "the share of the curvature that delta is to be"),
        };
        if value.is_finite() && value > 0.0 {
            Ok(value)
        } else {
            Err(Error::argument(what, value, "positive and finite"))
        }
    }

    /// The offset on a surface, 1/m; measures it if the offset is a share.
    ///
    /// # Errors
    /// As [`number`](Self::number).
    pub(super) fn on(self, surface: &dyn Surface) -> Result<f64> {
        let number = self.number()?;
        Ok(match self {
            Self::Absolute(_) => number,
            Self::Auto(_) => {
                let Measures { rms_curvature, extent, .. } = surface.measures();
                let bends = rms_curvature * extent > PLANE_BEND;
                if bends { number * rms_curvature } else { extent.recip() }
            }
        })
    }
}

impl Default for Delta {
    fn default() -> Self {
        Self::Auto(Self::DEFAULT_SHARE)
    }
}
