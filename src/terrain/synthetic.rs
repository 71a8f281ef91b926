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
//! use ridgeway::terrain::synthetic::{Synthetic, SyntheticKind};
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
use crate::{Crs, Error, GridFrame, Ground, HeightJet, Result, Terrain};

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
    /// Four equal round hills that meet, as in figure 6 of Seong, Jeong, Cohen (SMI 2008).
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
            Self::Fractal => 0.4,
            Self::Craters => 0.12,
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
        let mut heights = vec![0.0; self.cols * self.rows];
        heights.par_chunks_mut(self.cols).enumerate().for_each(|(row, line)| {
            for (col, z) in line.iter_mut().enumerate() {
                let at = self.position(col, row);
                *z = self.height(at.x, at.y);
            }
        });
        heights
    }

    /// The terrain with its centre at map coordinates `centre` of `crs`.
    ///
    /// # Errors
    /// [`Error::Usage`] if `crs` is not a plane one in metres or feet, or `centre` is not finite.
    pub fn terrain(&self, crs: Crs, centre: DVec2) -> Result<Terrain> {
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
        Terrain::new(frame, self.heights(), crs)
    }

    /// The formula of each kind: metres in, metres out.
    fn shape<T: Scalar>(&self, x: T, y: T) -> T {
        let h = self.relief;
        let (u, v) = (x * self.half_extent.recip(), y * self.half_extent.recip());
        match self.kind {
            SyntheticKind::Plane => (u * 0.6 + v * 0.8) * (0.5 * h),
            SyntheticKind::Cylinder => arc(self.arc_curvature(), x * x),
            SyntheticKind::Sphere => -arc(self.arc_curvature(), x * x + y * y) + h,
            SyntheticKind::Cone => -(u * u + v * v).sqrt() * h + h,
            SyntheticKind::Bumps => hills(&FIVE_HILLS, u, v) * h,
            SyntheticKind::FourBumps => hills(&FOUR_HILLS, u, v) * h,
            SyntheticKind::Range => range(self.seed, self.octaves(), u, v) * h,
            SyntheticKind::Fractal => {
                ridged(self.seed, self.octaves(), u * 1.5, v * 1.5) * (0.6 * h)
            }
            SyntheticKind::Craters => craters(self.seed, u, v) * h,
            SyntheticKind::Switchbacks => switchbacks(u, v) * h,
        }
    }

    /// Signed curvature `1/R = 2h / (a² + h²)` of the circle through the rim and `h` below it.
    fn arc_curvature(&self) -> f64 {
        let (a, h) = (self.half_extent, self.relief);
        2.0 * h / (a * a + h * h)
    }

    /// Octaves of noise, the first of wavelength `a`, that the grid can show: four cells per wave.
    fn octaves(&self) -> u32 {
        (self.half_extent / (4.0 * self.spacing)).max(1.0).log2() as u32 + 1
    }
}

/// Rise of a circle of curvature `c` over its lowest point, as a function of the squared distance `q`
/// from it: `c q / (1 + √(1 − c² q))`, and the tangent from `|c| √q = 0.9` on.
fn arc<T: Scalar>(c: f64, q: T) -> T {
    const LAST: f64 = 0.9;
    let inside = q.value().min((LAST / c).powi(2));
    let w = (1.0 - c * c * inside).sqrt();
    let rise = c * inside / (1.0 + w);
    if q.value() <= inside {
        return q.chain([rise, 0.5 * c / w, 0.25 * (c / w).powi(3)]);
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

const FOUR_HILLS: [Hill; 4] = [
    (-0.45, -0.45, 1.0, 0.22),
    (0.45, -0.45, 1.0, 0.22),
    (-0.45, 0.45, 1.0, 0.22),
    (0.45, 0.45, 1.0, 0.22),
];

fn hills<T: Scalar>(hills: &[Hill], u: T, v: T) -> T {
    hills.iter().fold(u * 0.0, |sum, &(east, north, height, deviation)| {
        let (u, v) = (u - east, v - north);
        sum + ((u * u + v * v) * (-0.5 / (deviation * deviation))).exp() * height
    })
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
    let spurs = ridged(hash(seed, 3), octaves, u * 3.0, v * 3.0);
    wave * crest + (wave * 0.85 + 0.15) * spurs * 0.3
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
        let q = (u * u + v * v) * radius.powi(-2);
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

    fn all(cols: usize, rows: usize, spacing: f64) -> impl Iterator<Item = Synthetic> {
        SyntheticKind::ALL
            .into_iter()
            .map(move |kind| Synthetic::new(kind, cols, rows, spacing).unwrap().with_seed(7))
    }

    #[test]
    fn jets_are_the_derivatives_of_the_height() {
        for terrain in all(101, 81, 10.0) {
            let e = 1e-3;
            for (x, y) in [(33.0, -57.0), (-210.5, 120.25), (301.0, 199.0)] {
                let jet = terrain.jet(x, y);
                let z = |dx: f64, dy: f64| terrain.height(x + dx * e, y + dy * e);
                assert_eq!(jet.z, z(0.0, 0.0));
                let first =
                    [(z(1.0, 0.0) - z(-1.0, 0.0), jet.zx), (z(0.0, 1.0) - z(0.0, -1.0), jet.zy)];
                for (difference, exact) in first {
                    assert!(
                        (difference / (2.0 * e) - exact).abs() < 1e-6,
                        "{} at {x}, {y}",
                        terrain.kind()
                    );
                }
                let slope = |dx: f64, dy: f64| terrain.jet(x + dx * e, y + dy * e);
                let (east, west) = (slope(1.0, 0.0), slope(-1.0, 0.0));
                let (north, south) = (slope(0.0, 1.0), slope(0.0, -1.0));
                for (difference, exact) in [
                    (east.zx - west.zx, jet.zxx),
                    (east.zy - west.zy, jet.zxy),
                    (north.zx - south.zx, jet.zxy),
                    (north.zy - south.zy, jet.zyy),
                ] {
                    assert!(
                        (difference / (2.0 * e) - exact).abs() < 1e-6,
                        "{} at {x}, {y}",
                        terrain.kind()
                    );
                }
            }
        }
    }

    #[test]
    fn heights_are_finite_and_fill_the_relief_at_any_size() {
        for (cols, rows) in [(1, 1), (1, 7), (2, 2), (300, 200)] {
            for terrain in all(cols, rows, 25.0) {
                let heights = terrain.heights();
                assert!(heights.iter().all(|z| z.is_finite()), "{} {cols}x{rows}", terrain.kind());
                if cols == 300 {
                    let range = heights.iter().copied().fold(f64::MIN, f64::max)
                        - heights.iter().copied().fold(f64::MAX, f64::min);
                    let share = range / terrain.relief();
                    assert!((0.4..2.5).contains(&share), "{}: {share}", terrain.kind());
                }
            }
        }
    }

    #[test]
    fn names_round_trip() {
        for kind in SyntheticKind::ALL {
            assert_eq!(kind.name().parse::<SyntheticKind>().unwrap(), kind);
            assert!(!kind.description().is_empty());
        }
        assert!("volcano".parse::<SyntheticKind>().is_err());
    }

    #[test]
    fn cylinder_and_sphere_have_the_curvature_they_promise() {
        let trough = Synthetic::new(SyntheticKind::Cylinder, 101, 51, 10.0).unwrap();
        let radius = trough.radius().unwrap();
        for x in [-300.0, 0.0, 120.0, 400.0] {
            let curvature = trough.jet(x, 33.0).curvature();
            assert!((curvature.principal[0] - radius.recip()).abs() < 1e-12);
            assert!(curvature.principal[1].abs() < 1e-12);
        }
        let dome = Synthetic::new(SyntheticKind::Sphere, 101, 51, 10.0).unwrap();
        let curvature = dome.jet(120.0, -80.0).curvature();
        assert!(
            curvature.principal.iter().all(|k| (k + dome.radius().unwrap().recip()).abs() < 1e-12)
        );
    }

    #[test]
    fn seeds_change_the_noisy_kinds_only_and_spacing_none() {
        for kind in SyntheticKind::ALL {
            let terrain = Synthetic::new(kind, 65, 65, 8.0).unwrap();
            let noisy = matches!(
                kind,
                SyntheticKind::Range | SyntheticKind::Fractal | SyntheticKind::Craters
            );
            assert_eq!(terrain.heights() != terrain.with_seed(9).heights(), noisy, "{kind}");
            if !noisy {
                let fine = Synthetic::new(kind, 129, 129, 4.0).unwrap();
                assert!((fine.height(50.0, -70.0) - terrain.height(50.0, -70.0)).abs() < 1e-9);
            }
        }
    }
}
