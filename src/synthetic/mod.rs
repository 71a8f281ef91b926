//! Terrains made from a formula: derivatives known exactly, distances too where geometry allows.
//!
//! Every kind is one smooth function of `(x, y)`, metres east and north of the **centre** of the grid,
//! and fills the grid whatever its size: `a`, half the longer side, is the unit of its horizontal shape,
//! and [`relief`](Synthetic::with_relief) that of its vertical shape. The same kind, seed, extent and
//! relief at a finer spacing is the same terrain; the noisy ones gain detail down to four cells.
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

mod noise;
mod scalar;

use std::f64::consts::{PI, TAU};
use std::fmt;
use std::str::FromStr;

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use self::noise::{gradient_noise, hash, ridged, uniform_pair};
use self::scalar::{Jet, Scalar};
use crate::control::Control;
use crate::error::{Error, Result};
use crate::grid::{GridFrame, Ground};
use crate::surface::HeightJet;
use crate::terrain::{Crs, Terrain};

/// The shapes there are. `h` is the relief, `a` half the longer side, both in metres.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum SyntheticKind {
    /// `z = h (0.6 x + 0.8 y) / 2a`: a slope of `h / 2a` that climbs towards N 37° E.
    Plane,
    /// A trough along `y` with the cross-section of a circle of radius `R`, `h` deep at `|x| = a`:
    /// `z = R − √(R² − x²)`, `R = (a² + h²) / 2h`.
    ///
    /// A cylinder while `|x| ≤ 0.9 R`, and beyond that its tangent plane.
    Cylinder,
    /// A dome, part of a sphere of radius `R`, `h` high over its rim at `√(x² + y²) = a`:
    /// `z = h − R + √(R² − x² − y²)`, `R = (a² + h²) / 2h`.
    ///
    /// A sphere within `0.9 R` of the centre, and beyond that its tangent cone.
    Sphere,
    /// `z = h (1 − √(x² + y²) / a)`: sharp at the tip, where the jet's derivatives are not numbers.
    Cone,
    /// Five round hills of different height and width, not touching the border.
    Bumps,
    /// Four equal hills with broad tops that meet, as in figure 6 of Seong, Jeong, Cohen (SMI 2008):
    /// `z = h Σ exp(−(r_i / 0.64 a)⁴)` with the distances `r_i` from `(±2a/3, ±2a/3)`.
    FourBumps,
    /// Long parallel ridges with valleys between, passes, and spurs down the flanks.
    Range,
    /// Mountains at every scale: ridged multifractal noise.
    Fractal,
    /// A plain under craters of many sizes.
    Craters,
    /// A mountainside rising northwards with a mean grade of `h / 2a`, carved by a zigzag of five
    /// benches that climbs it gently.
    Switchbacks,
}

impl SyntheticKind {
    /// All kinds, simple ones first.
    pub const ALL: [Self; 10] = [
        Self::Plane,
        Self::Cylinder,
        Self::Sphere,
        Self::Cone,
        Self::Bumps,
        Self::FourBumps,
        Self::Range,
        Self::Fractal,
        Self::Craters,
        Self::Switchbacks,
    ];

    /// Name on the command line.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Plane => "plane",
            Self::Cylinder => "cylinder",
            Self::Sphere => "sphere",
            Self::Cone => "cone",
            Self::Bumps => "bumps",
            Self::FourBumps => "four-bumps",
            Self::Range => "range",
            Self::Fractal => "fractal",
            Self::Craters => "craters",
            Self::Switchbacks => "switchbacks",
        }
    }

    /// What it is, in a line for people.
    #[must_use]
    pub fn description(self) -> &'static str {
        match self {
            Self::Plane => "even slope; distances known exactly",
            Self::Cylinder => "trough with a circular cross-section; distances known exactly",
            Self::Sphere => "dome, the cap of a sphere; distances known exactly",
            Self::Cone => "cone with a sharp tip",
            Self::Bumps => "five round hills of different size",
            Self::FourBumps => "four equal hills that meet",
            Self::Range => "long ridges and valleys with passes and spurs (seeded)",
            Self::Fractal => "mountains with detail at every scale (seeded)",
            Self::Craters => "plain under craters of many sizes (seeded)",
            Self::Switchbacks => "steep mountainside with a zigzag of benches",
        }
    }

    /// Default relief in units of `a`.
    fn default_relief(self) -> f64 {
        match self {
            Self::Plane | Self::FourBumps => 0.4,
            Self::Cylinder | Self::Sphere | Self::Cone => 0.5,
            Self::Bumps => 0.3,
            Self::Range => 0.25,
            Self::Fractal => 0.35,
            Self::Craters => 0.2,
            Self::Switchbacks => 1.0,
        }
    }
}

impl fmt::Display for SyntheticKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl FromStr for SyntheticKind {
    type Err = Error;

    fn from_str(name: &str) -> Result<Self> {
        Self::ALL.into_iter().find(|kind| kind.name() == name).ok_or_else(|| {
            let names = Self::ALL.map(Self::name).join(", ");
            Error::usage(format!("no synthetic terrain is called {name:?}; there are {names}"))
        })
    }
}

/// A terrain of one kind on a grid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Synthetic {
    kind: SyntheticKind,
    cols: usize,
    rows: usize,
    spacing: f64,
    half_extent: f64,
    relief: f64,
    seed: u64,
}

impl Synthetic {
    /// `cols × rows` nodes, `spacing` metres apart, with seed 0 and the kind's own relief.
    ///
    /// # Errors
    /// [`Error::Usage`] where [`GridFrame::new`] refuses the size or the spacing.
    pub fn new(kind: SyntheticKind, cols: usize, rows: usize, spacing: f64) -> Result<Self> {
        GridFrame::new(cols, rows, DVec2::ZERO, DVec2::splat(spacing), Ground::METRES)?;
        // A single node has no extent: half a cell keeps the formulas finite.
        let half_extent = 0.5 * spacing * (cols.max(rows) - 1).max(1) as f64;
        let relief = kind.default_relief() * half_extent;
        Ok(Self { kind, cols, rows, spacing, half_extent, relief, seed: 0 })
    }

    /// The same with other random numbers. Only `range`, `fractal` and `craters` use any.
    #[must_use]
    pub fn with_seed(self, seed: u64) -> Self {
        Self { seed, ..self }
    }

    /// The same with relief `h`, in metres: the vertical measure in the formulas of [`SyntheticKind`];
    /// of the noisy kinds, roughly the range of heights. Negative turns hills into hollows.
    ///
    /// # Errors
    /// [`Error::Usage`] if `relief` is not a finite number, or if a cylinder or sphere would be deeper
    /// than half the longer side of the grid: no circle is.
    pub fn with_relief(self, relief: f64) -> Result<Self> {
        if !relief.is_finite() {
            return Err(Error::usage(format!("the relief must be a finite number, not {relief}")));
        }
        let round = matches!(self.kind, SyntheticKind::Cylinder | SyntheticKind::Sphere);
        if round && relief.abs() > self.half_extent {
            return Err(Error::usage(format!(
                "a {} on this grid can have a relief of at most {} m, half its longer side; got {relief} m",
                self.kind, self.half_extent
            )));
        }
        Ok(Self { relief, ..self })
    }

    /// The shape.
    #[must_use]
    pub fn kind(&self) -> SyntheticKind {
        self.kind
    }

    /// Relief `h` in metres.
    #[must_use]
    pub fn relief(&self) -> f64 {
        self.relief
    }

    /// Radius `R` of a cylinder or sphere in metres, infinite without relief; `None` for other kinds.
    #[must_use]
    pub fn radius(&self) -> Option<f64> {
        let round = matches!(self.kind, SyntheticKind::Cylinder | SyntheticKind::Sphere);
        round.then(|| self.arc_curvature().abs().recip())
    }

    /// Metres east and north of the centre at node `(col, row)`.
    #[must_use]
    pub fn position(&self, col: usize, row: usize) -> DVec2 {
        let from_centre = |index: usize, count: usize| index as f64 - 0.5 * (count - 1) as f64;
        DVec2::new(from_centre(col, self.cols), -from_centre(row, self.rows)) * self.spacing
    }

    /// Height in metres, `x` metres east and `y` metres north of the centre.
    #[must_use]
    pub fn height(&self, x: f64, y: f64) -> f64 {
        self.shape(x, y)
    }

    /// Height and exact derivatives, `x` metres east and `y` metres north of the centre.
    #[must_use]
    pub fn jet(&self, x: f64, y: f64) -> HeightJet {
        let (x, y) = Jet::variables(x, y);
        self.shape(x, y).get()
    }

    /// Heights at the nodes in metres, row by row from the north.
    #[must_use]
    pub fn heights(&self) -> Vec<f64> {
        self.heights_under(&Control::default()).expect("nobody cancels")
    }

    fn heights_under(&self, control: &Control) -> Result<Vec<f64>> {
        let mut heights = vec![0.0; self.cols * self.rows];
        heights.par_chunks_mut(self.cols).enumerate().try_for_each(|(row, line)| {
            control.check()?;
            for (col, z) in line.iter_mut().enumerate() {
                let at = self.position(col, row);
                *z = self.height(at.x, at.y);
            }
            Ok(())
        })?;
        Ok(heights)
    }

    /// The terrain with its centre at map coordinates `centre` of `crs`.
    ///
    /// # Errors
    /// [`Error::Usage`] if `crs` is not a plane one in metres or feet, or `centre` is not finite.
    pub fn terrain(&self, crs: Crs, centre: DVec2) -> Result<Terrain> {
        self.terrain_under(crs, centre, &Control::default())
    }

    /// [`terrain`](Self::terrain) that can be cancelled.
    ///
    /// # Errors
    /// As [`terrain`](Self::terrain); cancelled.
    pub fn terrain_under(&self, crs: Crs, centre: DVec2, control: &Control) -> Result<Terrain> {
        let Ground::Plane { metres_per_unit } = crs.ground() else {
            return Err(Error::usage(format!(
                "a synthetic terrain has cells of equal size in metres, which {} has not; \
                 choose a projected CRS such as a UTM zone",
                crs.name()
            )));
        };
        let north_west = centre + self.position(0, 0) / metres_per_unit;
        let step = DVec2::splat(self.spacing / metres_per_unit);
        let frame = GridFrame::new(self.cols, self.rows, north_west, step, crs.ground())?;
        Terrain::new(frame, self.heights_under(control)?, crs)
    }

    /// The formula of each kind: metres in, metres out.
    fn shape<T: Scalar>(&self, x: T, y: T) -> T {
        let h = self.relief;
        let (u, v) = (x * self.half_extent.recip(), y * self.half_extent.recip());
        // The factors of the noisy kinds make their usual range of heights about 1.
        match self.kind {
            SyntheticKind::Plane => (u * 0.6 + v * 0.8) * (0.5 * h),
            SyntheticKind::Cylinder => arc(self.arc_curvature(), x * x),
            SyntheticKind::Sphere => -arc(self.arc_curvature(), x * x + y * y) + h,
            SyntheticKind::Cone => -(u * u + v * v).sqrt() * h + h,
            SyntheticKind::Bumps => hills(&FIVE_HILLS, u, v) * h,
            SyntheticKind::FourBumps => four_hills(u, v) * h,
            SyntheticKind::Range => range(self.seed, self.octaves(), u, v) * (0.75 * h),
            SyntheticKind::Fractal => mountains(self.seed, self.octaves(), u, v) * (0.6 * h),
            SyntheticKind::Craters => craters(self.seed, u, v) * (0.5 * h),
            SyntheticKind::Switchbacks => switchbacks(u, v) * h,
        }
    }

    /// Signed curvature `1/R = 2h / (a² + h²)` of the circle through the rim and `h` below it.
    fn arc_curvature(&self) -> f64 {
        let (a, h) = (self.half_extent, self.relief);
        2.0 * h / (a * a + h * h)
    }

    /// Octaves of noise that the grid can show, if the first has a wavelength of about `a`: the last is no
    /// shorter than four cells.
    fn octaves(&self) -> u32 {
        (self.cols.max(self.rows) / 8).max(1).ilog2() + 1
    }
}

/// Rise of a circle of curvature `c` over its lowest point, as a function of the squared distance `q`
/// from it: `c q / (1 + √(1 − c² q))`, and the tangent from `|c| √q = 0.9` on.
fn arc<T: Scalar>(c: f64, q: T) -> T {
    const LAST: f64 = 0.9;
    let inside = q.value().min((LAST / c) * (LAST / c));
    let w = (1.0 - c * c * inside).sqrt();
    let rise = c * inside / (1.0 + w);
    if q.value() <= inside {
        return q.chain([rise, 0.5 * c / w, 0.25 * (c / w) * (c / w) * (c / w)]);
    }
    let slope = LAST.copysign(c) / w;
    (q.sqrt() - inside.sqrt()) * slope + rise
}

/// Gaussian hills `(east, north, height, standard deviation)`; lengths in units of `a`.
type Hill = (f64, f64, f64, f64);

const FIVE_HILLS: [Hill; 5] = [
    (-0.44, -0.40, 0.8, 0.18),
    (0.40, -0.48, 8.0 / 15.0, 0.24),
    (0.24, 0.36, 1.0, 0.22),
    (-0.52, 0.48, 0.4, 0.30),
    (-0.06, -0.12, 1.0 / 3.0, 0.12),
];

fn hills<T: Scalar>(hills: &[Hill], u: T, v: T) -> T {
    hills.iter().fold(u * 0.0, |sum, &(east, north, height, deviation)| {
        let (u, v) = (u - east, v - north);
        sum + ((u * u + v * v) * (-0.5 / (deviation * deviation))).exp() * height
    })
}

/// Hills in the four quarters, flat at the top, that meet on the axes.
fn four_hills<T: Scalar>(u: T, v: T) -> T {
    const AWAY: f64 = 2.0 / 3.0;
    const WIDTH: f64 = 0.64;
    [(-AWAY, -AWAY), (AWAY, -AWAY), (-AWAY, AWAY), (AWAY, AWAY)].into_iter().fold(
        u * 0.0,
        |sum, (east, north)| {
            let (u, v) = (u - east, v - north);
            let q = (u * u + v * v) * (WIDTH * WIDTH).recip();
            sum + (q * q * -1.0).exp()
        },
    )
}

/// Waves across the strike N 37° E, bent by slow noise; crests and valley floors rise and sink along
/// the strike, and ridged noise that fades towards the valley floors carves the spurs.
fn range<T: Scalar>(seed: u64, octaves: u32, u: T, v: T) -> T {
    /// Ridges per unit of `a`.
    const FREQUENCY: f64 = 1.6;
    let bend = gradient_noise(hash(seed, 1), u * 1.3, v * 1.3) * 0.35;
    let across = u * 0.8 - v * 0.6 + bend;
    let wave = (across * (TAU * FREQUENCY)).cos() * 0.5 + 0.5;
    let crest = gradient_noise(hash(seed, 2), u * 2.6, v * 2.6) * 0.9 + 0.6;
    let spurs = ridged(hash(seed, 3), octaves, u * 2.0, v * 2.0);
    wave * crest + (wave * 0.85 + 0.15) * spurs * 0.25
}

/// Ridged noise, tall where slow noise is high and bent by it, so that massifs alternate with basins.
fn mountains<T: Scalar>(seed: u64, octaves: u32, u: T, v: T) -> T {
    let [high, east, north] =
        [1, 2, 3].map(|stream| gradient_noise(hash(seed, stream), u * 1.1 + 0.3, v * 1.1 + 0.6));
    let ridges = ridged(hash(seed, 4), octaves, u * 1.5 + east * 0.6, v * 1.5 + north * 0.6);
    ridges * (high * 0.7 + 0.6) + high * 0.4
}

/// Craters with radii between 0.04 and 0.35, as many larger than `r` as `1/r²`, on a rolling plain.
///
/// Each adds `(q − 0.8) exp(−q) · depth`, `q` the squared distance in radii: a bowl and a rim a fifth as high.
fn craters<T: Scalar>(seed: u64, u: T, v: T) -> T {
    const COUNT: u64 = 70;
    const RADII: (f64, f64) = (0.04, 0.35);
    let plain = gradient_noise(hash(seed, 0), u * 2.0, v * 2.0) * 0.3;
    (1..=COUNT).fold(plain, |sum, index| {
        let [east, north] = uniform_pair(hash(seed, 2 * index)).map(|t| 2.2 * t - 1.1);
        let [quantile, _] = uniform_pair(hash(seed, 2 * index + 1));
        let radius = (RADII.0 / (1.0 - quantile).sqrt()).min(RADII.1);
        let (u, v) = (u - east, v - north);
        let q = (u * u + v * v) * (radius * radius).recip();
        sum + (q - 0.8) * (-q).exp() * (4.0 * radius)
    })
}

/// Height 0 to 1 from south to north. With `t` that height and the phase `φ = 5πt`, benches lie at
/// `sin φ = ±1`, where `sin 2φ / …` takes out most of the slope; the last term tilts them eastwards and
/// westwards in turn, so that each nearly meets the next at its upper end.
fn switchbacks<T: Scalar>(u: T, v: T) -> T {
    const BENCHES: f64 = 5.0;
    /// Part of the slope that a bench loses.
    const FLATNESS: f64 = 0.85;
    /// Rise of a bench from the middle to the border, in bench intervals; at 0.5 it meets the next.
    const TILT: f64 = 0.42;
    let t = v * 0.5 + 0.5;
    let phase = t * (PI * BENCHES);
    t + (phase * 2.0).sin() * (0.5 * FLATNESS / (PI * BENCHES)) + u * phase.sin() * (TILT / BENCHES)
}

/// Exact distance over a cylinder of radius `radius` whose axis runs along `y`, in the metric's unit.
///
/// `from` and `to` are metres east and north of the lowest (or highest) line, `|x| ≤ radius`. With the arc
/// length `s` and a `δ` for the curvature tensor, `g = √(s² (δ + 1/R) + y² δ)`; without (`None`) the isotropic
/// distance `√(s² + y²)`. Routes are straight lines in `(s, y)`.
#[must_use]
pub fn cylinder_distance(radius: f64, delta: Option<f64>, from: DVec2, to: DVec2) -> f64 {
    let arc = radius * ((to.x / radius).asin() - (from.x / radius).asin());
    let along = to.y - from.y;
    let (arc_cost, along_cost) = delta.map_or((1.0, 1.0), |d| (d + radius.recip(), d));
    (arc * arc * arc_cost + along * along * along_cost).sqrt()
}

/// Exact distance over a sphere of radius `radius`, in the metric's unit.
///
/// `from` and `to` are metres east and north of the top, on the same hemisphere. The great-circle distance,
/// times `√(δ + 1/R)` for the curvature tensor with a `δ`. It is the distance on a cap only where the great
/// circle, which bulges away from the top, stays on the cap.
#[must_use]
pub fn sphere_distance(radius: f64, delta: Option<f64>, from: DVec2, to: DVec2) -> f64 {
    let lift = |p: DVec2| p.extend((radius * radius - p.length_squared()).sqrt());
    let (p, q): (DVec3, DVec3) = (lift(from), lift(to));
    let great_circle = radius * p.cross(q).length().atan2(p.dot(q));
    great_circle * delta.map_or(1.0, |d| (d + radius.recip()).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn who_cancels_gets_no_terrain() {
        let range = Synthetic::new(SyntheticKind::Range, 9, 9, 30.0).unwrap();
        let control = Control::default();
        control.cancel.cancel();
        let terrain = range.terrain_under(Crs::none(), DVec2::ZERO, &control);
        assert!(matches!(terrain, Err(Error::Cancelled)));
    }

    fn all(cols: usize, rows: usize, spacing: f64) -> impl Iterator<Item = Synthetic> {
        SyntheticKind::ALL
            .into_iter()
            .map(move |kind| Synthetic::new(kind, cols, rows, spacing).unwrap().with_seed(7))
    }

    #[test]
    fn names_round_trip() {
        for kind in SyntheticKind::ALL {
            assert_eq!(kind.name().parse::<SyntheticKind>().unwrap(), kind);
        }
        let error = "hills".parse::<SyntheticKind>().unwrap_err().to_string();
        assert!(error.contains("hills") && error.contains("four-bumps"), "{error}");
    }

    #[test]
    fn heights_are_finite_at_odd_sizes() {
        for (cols, rows) in [(1, 1), (1, 7), (2, 1), (300, 200)] {
            for terrain in all(cols, rows, 30.0) {
                let heights = terrain.heights();
                assert_eq!(heights.len(), cols * rows);
                assert!(heights.iter().all(|z| z.is_finite()), "{} {cols}x{rows}", terrain.kind());
            }
        }
    }

    #[test]
    fn impossible_terrains_are_refused() {
        let new = |cols, spacing| Synthetic::new(SyntheticKind::Cylinder, cols, 5, spacing);
        assert!(new(0, 1.0).is_err());
        assert!(new(usize::MAX, 1.0).is_err());
        assert!(new(5, 0.0).is_err());
        assert!(new(5, f64::NAN).is_err());
        assert!(new(5, 10.0).unwrap().with_relief(20.0).is_ok());
        assert!(new(5, 10.0).unwrap().with_relief(20.1).is_err());
        assert!(new(5, 10.0).unwrap().with_relief(f64::INFINITY).is_err());
    }

    #[test]
    fn row_0_is_north_and_column_0_is_west() {
        let plane = Synthetic::new(SyntheticKind::Plane, 3, 2, 10.0).unwrap();
        assert_eq!(plane.position(0, 0), DVec2::new(-10.0, 5.0));
        let jet = plane.jet(0.0, 0.0);
        // h / 2a = 0.2, towards (0.6, 0.8).
        assert!((jet.zx - 0.12).abs() < 1e-15 && (jet.zy - 0.16).abs() < 1e-15);
        let heights = plane.heights();
        assert!((heights[1] - heights[0] - 1.2).abs() < 1e-12);
        assert!((heights[0] - heights[3] - 1.6).abs() < 1e-12);
    }

    #[test]
    fn jets_are_the_derivatives_of_the_heights() {
        for terrain in all(301, 201, 10.0) {
            // Off the axes, and among them one beyond 0.9 R of the sphere.
            for (x, y) in [(123.4, -56.7), (-801.0, 433.0), (1402.0, 951.0)] {
                let step = 0.01;
                let at = |i: f64, j: f64| terrain.height(x + i * step, y + j * step);
                let jet = terrain.jet(x, y);
                assert_eq!(jet.z, at(0.0, 0.0));
                let slope = |value: f64, i: f64, j: f64| {
                    let estimate = (at(i, j) - at(-i, -j)) / (2.0 * step);
                    assert!(
                        (value - estimate).abs() < 1e-6,
                        "{} {value} {estimate}",
                        terrain.kind()
                    );
                };
                slope(jet.zx, 1.0, 0.0);
                slope(jet.zy, 0.0, 1.0);
                let bend = |value: f64, i: f64, j: f64| {
                    let estimate = (at(i, j) - 2.0 * jet.z + at(-i, -j)) / (step * step);
                    assert!(
                        (value - estimate).abs() < 1e-5,
                        "{} {value} {estimate}",
                        terrain.kind()
                    );
                };
                bend(jet.zxx, 1.0, 0.0);
                bend(jet.zyy, 0.0, 1.0);
                bend(jet.zxx + 2.0 * jet.zxy + jet.zyy, 1.0, 1.0);
            }
        }
    }

    #[test]
    fn round_kinds_have_the_radius_they_say() {
        for relief in [500.0, 1500.0, -300.0] {
            let round =
                |kind| Synthetic::new(kind, 301, 301, 10.0).unwrap().with_relief(relief).unwrap();
            let (trough, dome) = (round(SyntheticKind::Cylinder), round(SyntheticKind::Sphere));
            let radius = dome.radius().unwrap();
            assert_eq!(trough.radius(), Some(radius));
            for x in [0.0, 0.3 * radius, -0.8 * radius] {
                let rise = radius - (radius * radius - x * x).sqrt();
                let expected = rise.copysign(relief);
                assert!((trough.height(x, 77.0) - expected).abs() < 1e-9);
                assert!((dome.height(0.6 * x, 0.8 * x) - (relief - expected)).abs() < 1e-9);
            }
        }
        // The rim, half the longer side away, is h above the bottom and below the top.
        let trough = all(301, 11, 10.0).find(|t| t.kind() == SyntheticKind::Cylinder).unwrap();
        assert!((trough.height(1500.0, 0.0) - trough.relief()).abs() < 1e-9);
    }

    #[test]
    fn round_kinds_continue_along_the_tangent() {
        let dome = Synthetic::new(SyntheticKind::Sphere, 301, 301, 10.0).unwrap();
        let edge = 0.9 * dome.radius().unwrap();
        let (inside, outside) = (dome.jet(edge - 1e-6, 0.0), dome.jet(edge + 1e-6, 0.0));
        assert!((inside.z - outside.z).abs() < 1e-5 && (inside.zx - outside.zx).abs() < 1e-5);
        assert!(outside.zxx.abs() < 1e-12);
    }

    #[test]
    fn finer_spacing_keeps_the_terrain() {
        for terrain in all(129, 129, 80.0) {
            let finer = Synthetic::new(terrain.kind(), 513, 513, 20.0).unwrap().with_seed(7);
            let (coarse, fine) = (terrain.heights(), finer.heights());
            for row in 0..129 {
                for col in 0..129 {
                    let change = (coarse[row * 129 + col] - fine[4 * row * 513 + 4 * col]).abs();
                    assert!(change < 0.06 * terrain.relief(), "{} {change}", terrain.kind());
                }
            }
        }
    }

    #[test]
    fn seeds_matter_only_where_they_should() {
        for terrain in all(40, 40, 10.0) {
            use SyntheticKind::{Craters, Fractal, Range};
            let seeded = matches!(terrain.kind(), Craters | Fractal | Range);
            assert_eq!(terrain.heights() != terrain.with_seed(8).heights(), seeded);
        }
    }

    #[test]
    fn seeded_kinds_span_about_their_relief() {
        for seed in 0..10 {
            for terrain in all(201, 201, 40.0).map(|t| t.with_seed(seed)).skip(6).take(3) {
                let heights = terrain.heights();
                let highest = heights.iter().copied().fold(f64::MIN, f64::max);
                let lowest = heights.iter().copied().fold(f64::MAX, f64::min);
                let ratio = (highest - lowest) / terrain.relief();
                assert!((0.5..2.0).contains(&ratio), "{} seed {seed}: {ratio}", terrain.kind());
            }
        }
    }

    /// The hash of all kinds, computed once: the terrains of tomorrow are those of today.
    #[test]
    fn heights_keep_their_bits() {
        let digest = all(61, 47, 10.0)
            .flat_map(|terrain| terrain.heights())
            .fold(0, |digest, z| hash(digest, z.to_bits()));
        assert_eq!(digest, 8_088_881_159_426_029_533);
    }

    #[test]
    fn exact_distances_of_simple_cases() {
        let (r, quarter) = (100.0, std::f64::consts::FRAC_PI_2 * 100.0);
        let (west, east) = (DVec2::new(-r, 0.0), DVec2::new(r, 30.0));
        // Across and along the trough: a right triangle with legs πR and 30.
        let straight = (4.0 * quarter * quarter + 900.0).sqrt();
        assert!((cylinder_distance(r, None, west, east) - straight).abs() < 1e-12 * straight);
        // δ = 0 leaves only the curved direction, at √κ per metre.
        let across = cylinder_distance(r, Some(0.0), west, east);
        assert!((across - 2.0 * quarter * 0.1).abs() < 1e-12);
        // From the top of a sphere to its equator.
        let down = sphere_distance(r, None, DVec2::ZERO, DVec2::new(60.0, 80.0));
        assert!((down - quarter).abs() < 1e-12 * quarter);
        let curved = sphere_distance(r, Some(0.03), DVec2::ZERO, DVec2::new(60.0, 80.0));
        assert!((curved - 0.2 * quarter).abs() < 1e-12);
    }

    /// Walking along a bench is gentle, straight up is steep.
    #[test]
    fn switchbacks_offer_a_gentle_way() {
        let side = Synthetic::new(SyntheticKind::Switchbacks, 201, 201, 10.0).unwrap();
        // The second bench, where φ = 5π/2 and sin φ = 1, lies along t = 1/2: y = 0, and climbs east.
        let grade = (side.height(900.0, 0.0) - side.height(-900.0, 0.0)) / 1800.0;
        assert!((grade - 0.084).abs() < 1e-3, "{grade}");
        let steepest = (-1000..1000).map(|y| side.jet(0.0, f64::from(y)).zy).fold(0.0, f64::max);
        assert!(steepest > 0.9, "{steepest}");
    }
}
