//! Where the nodes of a grid lie: grid coordinates, map coordinates, metres.
//!
//! ```text
//!   grid (column, row)                 map (x, y)                  ground (metres)
//!
//!   (0,0)───(1,0)──▶ column            y ▲                         north ▲
//!     │       │                          │  node (0,0) is             v  │
//!   (0,1)───(1,1)                        │  the north-west one           │
//!     │                                  └──────────▶ x                  └────▶ u  east
//!     ▼ row
//! ```
//!
//! * **Grid coordinates** are a [`DVec2`] `(column, row)`; whole numbers are nodes, which are the
//!   *centres* of a raster's cells. Row 0 is the northernmost, column 0 the westernmost.
//! * **Map coordinates** are the file's: metres or feet for a projected CRS, degrees for a geographic one.
//! * **Ground vectors** are metres east and metres *north*. Derivatives of height, metric tensors and
//!   directions that leave the solver are in this frame, so `row` and `north` have opposite signs.
//!
//! Everything that measures asks [`GridFrame::spacing`], so a DEM in degrees is solved in metres.
//!
//! A grid of longitudes that goes all around is [periodic](GridFrame::is_periodic): after its last column comes the first again.

use glam::DVec2;

use crate::error::{Error, Result};

/// How one unit of map coordinates measures on the ground.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Ground {
    /// A plane map whose unit is this many metres (1 for metres, 0.3048 for international feet).
    Plane {
        /// Metres per map unit.
        metres_per_unit: f64,
    },
    /// Longitude and latitude in degrees on an ellipsoid: metres per degree vary with the row.
    Ellipsoid {
        /// Equatorial radius in metres.
        semi_major: f64,
        /// Flattening `(a − b)/a`; 0 for a sphere.
        flattening: f64,
    },
    /// Web Mercator (EPSG:3857): map metres are `1/cos(latitude)` too long, corrected row by row.
    WebMercator,
}

impl Ground {
    /// Metres on the plane.
    pub const METRES: Self = Self::Plane { metres_per_unit: 1.0 };
    /// Degrees on the WGS84 ellipsoid.
    pub const WGS84: Self =
        Self::Ellipsoid { semi_major: 6_378_137.0, flattening: 1.0 / 298.257_223_563 };

    /// Metres per map unit, eastward and northward, at map ordinate `y`.
    #[must_use]
    pub fn metres_per_unit(&self, y: f64) -> DVec2 {
        match *self {
            Self::Plane { metres_per_unit } => DVec2::splat(metres_per_unit),
            Self::Ellipsoid { semi_major, flattening } => {
                // Radii of curvature: N = a/√(1−e²sin²φ) of the prime vertical, M = N(1−e²)/(1−e²sin²φ)
                // of the meridian (Snyder, Map Projections, USGS PP 1395, eq. 4-18 to 4-20).
                let e2 = flattening * (2.0 - flattening);
                let (sin, cos) = y.to_radians().sin_cos();
                let w = 1.0 - e2 * sin * sin;
                let n = semi_major / w.sqrt();
                DVec2::new(n * cos, n * (1.0 - e2) / w) * 1f64.to_radians()
            }
            Self::WebMercator => {
                // Spherical Mercator y = a ln tan(π/4 + φ/2) applied to ellipsoidal latitudes: a map
                // metre is N cosφ/a ground metres eastward and M cosφ/a northward.
                const A: f64 = 6_378_137.0;
                let latitude = (y / A).sinh().atan();
                Self::WGS84.metres_per_unit(latitude.to_degrees()) * DVec2::new(1.0, latitude.cos())
                    / (A * 1f64.to_radians())
            }
        }
    }
}

/// A regular north-up grid of nodes and its place on the map.
#[derive(Clone, Debug, PartialEq)]
pub struct GridFrame {
    cols: usize,
    rows: usize,
    origin: DVec2,
    step: DVec2,
    ground: Ground,
    periodic: bool,
}

impl GridFrame {
    /// Most nodes a grid may have, so that a forged header cannot ask for absurd memory.
    pub const MAX_NODES: usize = 1 << 32;

    /// A grid of `cols × rows` nodes whose north-west node lies at map coordinates `origin`, with
    /// `step = (x per column, y per row towards the south)`, both positive, in map units.
    ///
    /// # Errors
    /// [`Error::Argument`] if a count is 0 or absurd, a number is not finite, a step not positive, or an
    /// ellipsoidal grid has nodes beyond a pole.
    pub fn new(
        cols: usize,
        rows: usize,
        origin: DVec2,
        step: DVec2,
        ground: Ground,
    ) -> Result<Self> {
        if cols == 0 || rows == 0 || cols.checked_mul(rows).is_none_or(|n| n > Self::MAX_NODES) {
            return Err(Error::argument(
                "the size of the grid",
                format!("{cols} columns × {rows} rows"),
                format!("at least 1 × 1 and at most {} nodes", Self::MAX_NODES),
            ));
        }
        if !origin.is_finite() {
            return Err(Error::argument("the origin of the grid", origin, "finite"));
        }
        if !step.is_finite() || step.min_element() <= 0.0 {
            return Err(Error::argument("the cell size", step, "positive and finite"));
        }
        let periodic = Self::columns_around(step.x, ground) == Some(cols);
        let frame = Self { cols, rows, origin, step, ground, periodic };
        if let Ground::Ellipsoid { .. } = ground {
            let south = frame.to_map(DVec2::new(0.0, (rows - 1) as f64)).y;
            if origin.y > 90.0 || south < -90.0 {
                let found = format!("{south} to {} degrees", origin.y);
                return Err(Error::argument("the range of latitudes", found, "within -90 and 90"));
            }
        }
        Ok(frame)
    }

    /// How many columns of a width of `step` map units go once around the body; `None` on a plane, and if no whole number does.
    #[must_use]
    pub fn columns_around(step: f64, ground: Ground) -> Option<usize> {
        /// Cells by which the end may miss the beginning: the width may be written with few digits.
        const TOLERANCE: f64 = 0.1;
        let cols = (360.0 / step).round();
        let is_around = matches!(ground, Ground::Ellipsoid { .. })
            && cols >= 3.0
            && (cols * step - 360.0).abs() < TOLERANCE * step;
        is_around.then_some(cols as usize)
    }

    /// Number of columns.
    #[must_use]
    pub fn cols(&self) -> usize {
        self.cols
    }

    /// Number of rows.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// Number of nodes.
    #[must_use]
    pub fn nodes(&self) -> usize {
        self.cols * self.rows
    }

    /// Map coordinates of node (0, 0), the centre of the north-western cell.
    #[must_use]
    pub fn origin(&self) -> DVec2 {
        self.origin
    }

    /// Map units per column (eastward) and per row (southward), both positive.
    #[must_use]
    pub fn step(&self) -> DVec2 {
        self.step
    }

    /// West, south, east and north border of the outermost cells, in map units.
    #[must_use]
    pub fn extent(&self) -> [f64; 4] {
        let half = 0.5 * self.step;
        let size = self.step * DVec2::new(self.cols as f64, self.rows as f64);
        let (west, north) = (self.origin.x - half.x, self.origin.y + half.y);
        [west, north - size.y, west + size.x, north]
    }

    /// How map units measure on the ground.
    #[must_use]
    pub fn ground(&self) -> Ground {
        self.ground
    }

    /// Map coordinates of grid coordinates `at`.
    #[must_use]
    pub fn to_map(&self, at: DVec2) -> DVec2 {
        self.origin + DVec2::new(at.x * self.step.x, -at.y * self.step.y)
    }

    /// Grid coordinates of map coordinates `map`.
    #[must_use]
    pub fn to_grid(&self, map: DVec2) -> DVec2 {
        let offset = map - self.origin;
        DVec2::new(offset.x / self.step.x, -offset.y / self.step.y)
    }

    /// Metres on the ground per column and per row at grid row `row`, both positive.
    #[must_use]
    pub fn spacing(&self, row: f64) -> DVec2 {
        self.step * self.ground.metres_per_unit(self.origin.y - row * self.step.y)
    }

    /// [`spacing`](Self::spacing) in the middle of the grid: the cell size to show to people.
    #[must_use]
    pub fn mid_spacing(&self) -> DVec2 {
        self.spacing((self.rows - 1) as f64 / 2.0)
    }

    /// Metres east and north of the grid step `by` taken around row `row`.
    #[must_use]
    pub fn ground_vector(&self, row: f64, by: DVec2) -> DVec2 {
        self.spacing(row) * DVec2::new(by.x, -by.y)
    }

    /// Whether the columns go around the body, so that column [`cols`](Self::cols) is column 0 again.
    #[must_use]
    pub fn is_periodic(&self) -> bool {
        self.periodic
    }

    /// Whether grid coordinates lie in the hull of the nodes, where the surface is defined. In a periodic direction all do.
    #[must_use]
    pub fn contains(&self, at: DVec2) -> bool {
        let at = self.in_first_turn(at);
        at.is_finite() && at == self.clamp(at)
    }

    /// Whether grid coordinates lie on a cell of the raster: the hull of the nodes and half a cell more.
    #[must_use]
    pub fn is_on_cell(&self, at: DVec2) -> bool {
        let at = self.in_first_turn(at);
        let last = DVec2::new(self.cols as f64 - 0.5, self.rows as f64 - 0.5);
        at.cmpge(DVec2::splat(-0.5)).all() && at.cmple(last).all()
    }

    /// The nearest grid coordinates in the hull of the nodes; in a periodic direction the same place on a cell of the raster.
    #[must_use]
    pub fn clamp(&self, at: DVec2) -> DVec2 {
        let last = DVec2::new((self.cols - 1) as f64, (self.rows - 1) as f64);
        let inside = at.clamp(DVec2::ZERO, last);
        if self.periodic { DVec2::new(self.in_first_turn(at).x, inside.y) } else { inside }
    }

    /// The same place with a column from −½ to less than `cols` − ½, if columns are periodic.
    fn in_first_turn(&self, at: DVec2) -> DVec2 {
        let within = at.x >= -0.5 && at.x < self.cols as f64 - 0.5;
        if !self.periodic || within {
            return at;
        }
        DVec2::new((at.x + 0.5).rem_euclid(self.cols as f64) - 0.5, at.y)
    }

    /// Index of node `(col, row)` in a row-major array.
    #[must_use]
    pub fn index(&self, col: usize, row: usize) -> usize {
        row * self.cols + col
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn metres_per_degree_match_published_values() {
        // WGS84: 110574.3 m per degree of latitude and 111319.5 m per degree of longitude at the equator;
        // 111131.7 and 78846.8 at 45° (NGA, tabulated lengths of a degree).
        let at = |y| Ground::WGS84.metres_per_unit(y);
        assert!((at(0.0) - DVec2::new(111_319.5, 110_574.3)).abs().max_element() < 0.1);
        assert!((at(45.0) - DVec2::new(78_846.8, 111_131.7)).abs().max_element() < 0.1);
    }

    #[test]
    fn web_mercator_shrinks_by_about_the_cosine_of_latitude() {
        let y = 6_378_137.0 * (45f64.to_radians().tan()).asinh();
        let scale = Ground::WebMercator.metres_per_unit(y);
        assert!((scale - DVec2::splat(45f64.to_radians().cos())).abs().max_element() < 3e-3);
    }

    #[test]
    fn map_and_grid_are_inverse() {
        let frame =
            GridFrame::new(7, 5, DVec2::new(1e5, 4e6), DVec2::new(30.0, 60.0), Ground::METRES)
                .unwrap();
        let at = DVec2::new(2.25, 3.5);
        assert_eq!(frame.to_map(at), DVec2::new(100_067.5, 3_999_790.0));
        assert!((frame.to_grid(frame.to_map(at)) - at).length() < 1e-12);
        assert_eq!(frame.ground_vector(0.0, DVec2::new(1.0, 1.0)), DVec2::new(30.0, -60.0));
    }

    #[test]
    fn a_grid_around_the_earth_is_periodic() {
        let around = |cols, step: f64| {
            GridFrame::new(cols, 3, DVec2::ZERO, DVec2::new(step, 1.0), Ground::WGS84).unwrap()
        };
        let globe = around(36, 10.0);
        assert!(globe.is_periodic() && around(432, 0.833333).is_periodic());
        for not in [around(35, 10.0), around(37, 10.0), around(2, 180.0), around(432, 0.82)] {
            assert!(!not.is_periodic());
        }
        let at = DVec2::new(37.25, 1.0);
        assert!(globe.contains(at) && globe.is_on_cell(at));
        assert_eq!(globe.clamp(at), DVec2::new(1.25, 1.0));
        assert_eq!(globe.clamp(DVec2::new(-0.75, 5.0)), DVec2::new(35.25, 2.0));
        assert!(!globe.contains(DVec2::new(1.0, 3.0)) && !globe.contains(DVec2::NAN));
        let plane = GridFrame::new(36, 3, DVec2::ZERO, DVec2::splat(10.0), Ground::METRES).unwrap();
        assert!(!plane.is_periodic() && !plane.contains(at));
    }

    #[test]
    fn impossible_frames_are_refused() {
        let new = |c, r, o, s| GridFrame::new(c, r, o, s, Ground::WGS84);
        assert!(new(0, 5, DVec2::ZERO, DVec2::ONE).is_err());
        assert!(new(usize::MAX, 5, DVec2::ZERO, DVec2::ONE).is_err());
        assert!(new(5, 5, DVec2::ZERO, DVec2::new(1.0, -1.0)).is_err());
        assert!(new(5, 5, DVec2::NAN, DVec2::ONE).is_err());
        assert!(new(5, 5, DVec2::new(0.0, 91.0), DVec2::ONE).is_err());
    }
}
