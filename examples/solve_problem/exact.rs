//! Closed forms of the distance from the middle.

use std::f64::consts::TAU;

use glam::DVec2;

use crate::problems::{DELTA, Problem, RADIUS, WARP, constant};

/// Exact distance at a point of the square; `None` where the closed form does not hold there.
pub(crate) type Exact = Box<dyn Fn(DVec2) -> Option<f64>>;

/// The closed form of a problem, if there is one.
pub(crate) fn exact(problem: Problem) -> Option<Exact> {
    // Slownesses of the cylinder's curvature tensor around and along.
    let curved = DVec2::new((DELTA + RADIUS.recip()).sqrt(), DELTA.sqrt());
    let arc = |plan: f64| RADIUS * (plan / RADIUS).asin();
    Some(match problem {
        Problem::Constant { ratio } => {
            let metric = constant(ratio).inverse();
            Box::new(move |at| Some(metric.norm(at)))
        }
        Problem::Diffeomorphism => {
            let horizon = Horizon::new();
            Box::new(move |at| horizon.sees(phi(at)).then(|| phi(at).length()))
        }
        Problem::LinearSpeed => Box::new(half_plane),
        Problem::Cylinder => {
            Box::new(move |at| Some((curved * DVec2::new(arc(at.x), at.y)).length()))
        }
        Problem::SphereCap => Box::new(move |at| Some(curved.x * arc(at.length()))),
        Problem::Hills
        | Problem::RandomSpeed
        | Problem::Rotating
        | Problem::Maze
        | Problem::Spiral => return None,
    })
}

/// Speed `1 + x` is the Poincaré half-plane with boundary `x = −1`: `cosh g = 1 + |p|²/(2(1 + x))` from the origin, and
/// shortest paths are arcs of circles centred on the boundary. Not valid where the arc leaves the square at `x = 1/2`.
fn half_plane(at: DVec2) -> Option<f64> {
    // The arc through the origin and `at` is centred at (−1, centre).
    let centre = ((1.0 + at.x).powi(2) + at.y * at.y - 1.0) / (2.0 * at.y);
    let passes_its_top = centre * at.y.signum() > 0.0 && centre.abs() < at.y.abs();
    let bulges = passes_its_top && centre.hypot(1.0) - 1.0 > 0.5;
    (!bulges).then(|| (1.0 + at.length_squared() / (2.0 * (1.0 + at.x))).acosh())
}

/// The map that straightens the shortest paths of [`Problem::Diffeomorphism`].
fn phi(at: DVec2) -> DVec2 {
    at + WARP * DVec2::new((TAU * at.y).sin(), (TAU * at.x).sin())
}

/// How far from the origin the image of the square under [`phi`] reaches in each direction: beyond, the preimage of
/// the straight line leaves the square.
struct Horizon([f64; Horizon::DIRECTIONS]);

impl Horizon {
    const DIRECTIONS: usize = 8192;

    fn new() -> Self {
        const STEPS: i32 = 100_000;
        let mut reach = [f64::INFINITY; Self::DIRECTIONS];
        for step in 0..=STEPS {
            let t = f64::from(step) / f64::from(STEPS) - 0.5;
            for (x, y) in [(t, 0.5), (t, -0.5), (0.5, t), (-0.5, t)] {
                let border = phi(DVec2::new(x, y));
                let least = &mut reach[Self::direction(border)];
                *least = least.min(border.length());
            }
        }
        Self(reach)
    }

    fn direction(image: DVec2) -> usize {
        let turn = (image.to_angle() / TAU + 0.5) * Self::DIRECTIONS as f64;
        turn as usize % Self::DIRECTIONS
    }

    /// With a margin of half a percent for the finite number of directions.
    fn sees(&self, image: DVec2) -> bool {
        let at = Self::direction(image);
        let neighbours =
            [at + Self::DIRECTIONS - 1, at, at + 1].map(|k| self.0[k % Self::DIRECTIONS]);
        image.length() < 0.995 * neighbours.into_iter().fold(f64::INFINITY, f64::min)
    }
}
