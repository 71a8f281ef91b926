//! A terrain of one kind on a grid.

use glam::DVec2;
use rayon::prelude::*;

use super::kind::SyntheticKind;
use super::scalar::Jet;
use super::shape::Parameters;
use crate::control::Control;
use crate::error::{Error, Result};
use crate::grid::{GridFrame, Ground};
use crate::surface::HeightJet;
use crate::terrain::{Crs, Terrain};

/// A terrain of one kind on a grid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Synthetic {
    kind: SyntheticKind,
    cols: usize,
    rows: usize,
    spacing: f64,
    parameters: Parameters,
}

impl Synthetic {
    /// `cols × rows` nodes, `spacing` metres apart, with seed 0 and the kind's own relief.
    ///
    /// # Errors
    /// [`Error::Argument`] where [`GridFrame::new`] refuses the size or the spacing.
    pub fn new(kind: SyntheticKind, cols: usize, rows: usize, spacing: f64) -> Result<Self> {
        GridFrame::new(cols, rows, DVec2::ZERO, DVec2::splat(spacing), Ground::METRES)?;
        let longer = cols.max(rows);
        // A single node has no extent: half a cell keeps the formulas finite.
        let half_extent = 0.5 * spacing * (longer - 1).max(1) as f64;
        let parameters = Parameters {
            half_extent,
            relief: kind.shape().default_relief * half_extent,
            seed: 0,
            // If the first octave has a wavelength of about `a`, the last is no shorter than four cells.
            octaves: (longer / 8).max(1).ilog2() + 1,
        };
        Ok(Self { kind, cols, rows, spacing, parameters })
    }

    /// The same with other random numbers. Only `range`, `fractal` and `craters` use any.
    #[must_use]
    pub fn with_seed(self, seed: u64) -> Self {
        Self { parameters: Parameters { seed, ..self.parameters }, ..self }
    }

    /// The same with relief `h`, in metres: the vertical measure in the formulas of [`SyntheticKind`];
    /// of the noisy kinds, roughly the range of heights. Negative turns hills into hollows.
    ///
    /// # Errors
    /// [`Error::Argument`] if `relief` is not a finite number, or if a cylinder or sphere would be deeper
    /// than half the longer side of the grid: no circle is.
    pub fn with_relief(self, relief: f64) -> Result<Self> {
        if !relief.is_finite() {
            return Err(Error::argument("the relief", relief, "finite"));
        }
        let most = self.parameters.half_extent;
        if self.kind.shape().round && relief.abs() > most {
            let what = format!("the relief of a {}", self.kind);
            let expected = format!("at most {most} m, half the longer side of the grid");
            return Err(Error::argument(what, format!("{relief} m"), expected));
        }
        Ok(Self { parameters: Parameters { relief, ..self.parameters }, ..self })
    }

    /// The kind of terrain.
    #[must_use]
    pub fn kind(&self) -> SyntheticKind {
        self.kind
    }

    /// Relief `h` in metres.
    #[must_use]
    pub fn relief(&self) -> f64 {
        self.parameters.relief
    }

    /// Radius `R` of a cylinder or sphere in metres, infinite without relief; `None` for other kinds.
    #[must_use]
    pub fn radius(&self) -> Option<f64> {
        self.kind.shape().round.then(|| self.parameters.arc_curvature().abs().recip())
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
        (self.kind.shape().height)(&self.parameters, x, y)
    }

    /// Height and exact derivatives, `x` metres east and `y` metres north of the centre.
    #[must_use]
    pub fn jet(&self, x: f64, y: f64) -> HeightJet {
        let (x, y) = Jet::variables(x, y);
        (self.kind.shape().jet)(&self.parameters, x, y).get()
    }

    /// Heights at the nodes in metres, row by row from the north.
    #[must_use]
    pub fn heights(&self) -> Vec<f64> {
        self.heights_with(&Control::default()).expect("nobody cancels")
    }

    fn heights_with(&self, control: &Control) -> Result<Vec<f64>> {
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
    /// [`Error::Argument`] if `crs` is not a plane one in metres or feet, or `centre` is not finite.
    pub fn terrain(&self, crs: Crs, centre: DVec2) -> Result<Terrain> {
        self.terrain_with(crs, centre, &Control::default())
    }

    /// [`terrain`](Self::terrain) that can be cancelled.
    ///
    /// # Errors
    /// As [`terrain`](Self::terrain); cancelled.
    pub fn terrain_with(&self, crs: Crs, centre: DVec2, control: &Control) -> Result<Terrain> {
        let Ground::Plane { metres_per_unit } = crs.ground() else {
            let expected = "a plane one in metres or feet, such as that of a UTM zone";
            return Err(Error::argument("the CRS of a synthetic terrain", crs.name(), expected));
        };
        let north_west = centre + self.position(0, 0) / metres_per_unit;
        let step = DVec2::splat(self.spacing / metres_per_unit);
        let frame = GridFrame::new(self.cols, self.rows, north_west, step, crs.ground())?;
        Terrain::new(frame, self.heights_with(control)?, crs)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synthetic::noise::hash;

    #[test]
    fn cancelling_gives_no_terrain() {
        let range = Synthetic::new(SyntheticKind::Range, 9, 9, 30.0).unwrap();
        let control = Control::default();
        control.cancel.cancel();
        let terrain = range.terrain_with(Crs::none(), DVec2::ZERO, &control);
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

    /// The hash of all kinds, computed once: a change of any bit of any height shows.
    #[test]
    fn heights_keep_their_bits() {
        let digest = all(61, 47, 10.0)
            .flat_map(|terrain| terrain.heights())
            .fold(0, |digest, z| hash(digest, z.to_bits()));
        assert_eq!(digest, 8_088_881_159_426_029_533);
    }

    /// Walking along a bench is gentle, straight up is steep.
    #[test]
    fn switchbacks_offer_a_gentle_path() {
        let side = Synthetic::new(SyntheticKind::Switchbacks, 201, 201, 10.0).unwrap();
        // The second bench, where φ = 5π/2 and sin φ = 1, lies along t = 1/2: y = 0, and climbs east.
        let grade = (side.height(900.0, 0.0) - side.height(-900.0, 0.0)) / 1800.0;
        assert!((grade - 0.084).abs() < 1e-3, "{grade}");
        let steepest = (-1000..1000).map(|y| side.jet(0.0, f64::from(y)).zy).fold(0.0, f64::max);
        assert!(steepest > 0.9, "{steepest}");
    }
}
