//! A surface in space as it is seen: projection into the picture, and brightness.

use glam::DVec3;

use crate::error::{Error, Result};

/// Share of the light that is everywhere.
const AMBIENT: f64 = 0.4;
/// The back of the surface, which its normal points away from, is this much darker.
const BACK: f64 = 0.75;

/// The viewer, with a light up and to the left. Parallel projection.
pub(super) struct Camera {
    right: DVec3,
    up: DVec3,
    /// To the viewer.
    view: DVec3,
}

impl Camera {
    pub(super) fn new(view: DVec3) -> Result<Self> {
        let view =
            view.try_normalize().ok_or_else(|| Error::argument("the view", view, "a direction"))?;
        // From straight above, y is up.
        let right = DVec3::Z.cross(view).try_normalize().unwrap_or(DVec3::X);
        Ok(Self { right, up: view.cross(right), view })
    }

    /// A point in the picture, m: right, down, towards the viewer.
    pub(super) fn project(&self, p: DVec3) -> DVec3 {
        DVec3::new(p.dot(self.right), -p.dot(self.up), p.dot(self.view))
    }

    /// Brightness of a piece of surface with this normal.
    pub(super) fn light(&self, normal: DVec3) -> f64 {
        let to_light = (self.view - 0.6 * self.right + 0.8 * self.up).normalize();
        let back = normal.dot(self.view) < 0.0;
        let normal = if back { -normal } else { normal };
        // Half of what faces away from the light would be black; so the form shows there too, and colours can be read.
        let light = AMBIENT + (1.0 - AMBIENT) * (0.5 + 0.5 * normal.dot(to_light));
        if back { BACK * light } else { light }
    }
}
