//! Where distance begins.

use geo_types::{
    Geometry, Line, LineString, MultiLineString, MultiPoint, MultiPolygon, Point, Polygon, Rect,
    Triangle,
};
use glam::DVec2;

use crate::error::{Error, Result};
use crate::grid::Shapes;
use crate::grid::tiling::Tiling;

/// Where paths begin: geometry in grid coordinates (column, row).
///
/// ```
/// use ridgeway::StartRegion;
/// use ridgeway::geo_types::{Rect, line_string};
/// use ridgeway::glam::DVec2;
///
/// let spring = StartRegion::from(DVec2::new(40.0, 60.5));
/// let road = StartRegion::from(line_string![(x: 3.0, y: 4.0), (x: 30.0, y: 4.5)]).with_value(250.0);
/// let lake = StartRegion::from(Rect::new((10.0, 10.0), (20.0, 15.0)));
/// # assert_eq!((spring.value, road.value, lake.shapes.polygons.len()), (0.0, 250.0, 1));
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct StartRegion {
    /// Points, lines and areas, every point of which is a start.
    pub shapes: Shapes,
    /// Distance already travelled there, in the unit of the metric: 0 or more. Default 0.
    pub value: f64,
}

impl From<DVec2> for StartRegion {
    fn from(point: DVec2) -> Self {
        Self::from(Point::new(point.x, point.y))
    }
}

impl From<Shapes> for StartRegion {
    fn from(shapes: Shapes) -> Self {
        Self { shapes, value: 0.0 }
    }
}

macro_rules! from_geometry {
    ($($geometry:ident)+) => {$(
        impl From<$geometry<f64>> for StartRegion {
            fn from(geometry: $geometry<f64>) -> Self {
                Shapes::from(geometry).into()
            }
        }
    )+};
}

from_geometry!(Point MultiPoint Line LineString MultiLineString Polygon MultiPolygon Rect Triangle Geometry);

impl StartRegion {
    /// The same region with `value` travelled already.
    #[must_use]
    pub fn with_value(self, value: f64) -> Self {
        Self { value, ..self }
    }

    /// # Errors
    /// A value or a coordinate that is no number; a region that reaches far around a periodic grid.
    pub(super) fn check(&self, tiling: &Tiling) -> Result<()> {
        /// A region may reach so many periods from the grid in a periodic direction.
        const MAX_PERIODS: f64 = 64.0;
        if !(self.value.is_finite() && self.value >= 0.0) {
            return Err(Error::argument("the value of a start region", self.value, "0 or more"));
        }
        let far = MAX_PERIODS * DVec2::new(tiling.cols as f64, tiling.rows as f64);
        let bad = |at: &DVec2| {
            let [across, down] = tiling.periodic;
            !at.is_finite() || (across && at.x.abs() > far.x) || (down && at.y.abs() > far.y)
        };
        match self.shapes.vertices().find(bad) {
            Some(at) => Err(Error::argument(
                "a point of the start",
                at,
                format!("finite, and within {MAX_PERIODS} periods of a grid that is periodic"),
            )),
            None => Ok(()),
        }
    }
}
