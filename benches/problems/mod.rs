//! The problems that the solver is timed and judged on, shared by the benches and `examples/solve_problem`.
//!
//! Each is a field of speed tensors on a square of side 1 with `n × n` nodes and the source in the middle. `x` runs
//! with the columns and `y` with the rows, both from −1/2 to 1/2. What is random has a fixed seed.

mod walls;

use std::f64::consts::{FRAC_PI_6, TAU};
use std::fmt;
use std::str::FromStr;

use glam::DVec2;
use ridgeway::eikonal::TensorField;
use ridgeway::{
    Accuracy, Control, Crs, Curvature, Delta, FitOptions, GridFrame, Ground, HeightJet,
    HeightSurface, Metric, Modifiers, Result, Smoothing, Solver, StartRegion, Sym2, Terrain,
};

/// Names of the accuracies there are, the best last, see [`solver`].
pub(crate) const ACCURACIES: [&str; 2] = ["fast", "high"];

/// The solver of an accuracy; `None` if there is no such.
pub(crate) fn solver(accuracy: &str) -> Option<Solver> {
    match accuracy {
        "fast" => Some(Solver::default()),
        "high" => Some(Solver { accuracy: Accuracy::High, ..Solver::default() }),
        _ => None,
    }
}

/// A field of speed tensors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Problem {
    /// One tensor everywhere, `ratio` times as large across as along an axis turned by 30°; 1 is the flat plane.
    Constant { ratio: f64 },
    /// `D = (ΦᵀΦ)⁻¹`, `Φ = Dφ`, under whose map `φ(x, y) = (x + A sin 2πy, y + A sin 2πx)`, `A` = [`WARP`], shortest
    /// paths are straight.
    Diffeomorphism,
    /// The curvature tensor of five Gaussian hills, from their exact derivatives.
    Hills,
    /// Isotropic, speed `1 + x`.
    LinearSpeed,
    /// The curvature tensor of a trough of radius [`RADIUS`], through the spline fit.
    Cylinder,
    /// The curvature tensor of a cap of radius [`RADIUS`], through the spline fit.
    SphereCap,
    /// Isotropic, a smooth random speed with contrast 100 : 1.
    RandomSpeed,
    /// Ratio 100 with an axis that turns several times across the square.
    Rotating,
    /// Isotropic, in a random maze without loops.
    Maze,
    /// Isotropic, in a spiral passage of twelve turns.
    Spiral,
}

/// Radius of cylinder and sphere cap.
pub(crate) const RADIUS: f64 = 0.8;
/// `δ` of their curvature tensor.
pub(crate) const DELTA: f64 = 0.25;

impl Problem {
    /// The start: the middle, in grid coordinates.
    pub(crate) fn start(n: usize) -> [StartRegion; 1] {
        [DVec2::splat(0.5 * (n - 1) as f64).into()]
    }

    /// The tensors at `n × n` nodes.
    pub(crate) fn field(self, n: usize, control: &Control) -> Result<TensorField> {
        let per_cell = ((n - 1) as f64).powi(2);
        let at = move |col: usize, row: usize| {
            DVec2::new(col as f64, row as f64) / (n - 1) as f64 - DVec2::splat(0.5)
        };
        let everywhere = |speed: &(dyn Fn(DVec2) -> Sym2 + Sync)| {
            TensorField::from_fn(n, n, |col, row| Some(speed(at(col, row)) * per_cell), control)
        };
        let between = |walls: Vec<bool>| {
            let plane = Sym2::new(per_cell, 0.0, per_cell);
            TensorField::from_fn(n, n, |col, row| (!walls[row * n + col]).then_some(plane), control)
        };
        match self {
            Self::Constant { ratio } => everywhere(&|_| constant(ratio)),
            Self::Diffeomorphism => everywhere(&diffeomorphism),
            Self::Hills => everywhere(&hills),
            Self::LinearSpeed => everywhere(&|at| isotropic(1.0 + at.x)),
            Self::Cylinder => {
                fitted(n, |at| RADIUS - (RADIUS * RADIUS - at.x * at.x).sqrt(), control)
            }
            Self::SphereCap => {
                fitted(n, |at| (RADIUS * RADIUS - at.length_squared()).sqrt(), control)
            }
            Self::RandomSpeed => everywhere(&random_speed()),
            Self::Rotating => everywhere(&rotating),
            Self::Maze => between(walls::maze(n)),
            Self::Spiral => between(walls::spiral(n)),
        }
    }
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Constant { ratio } => return write!(f, "constant-{ratio}"),
            Self::Diffeomorphism => "diffeomorphism",
            Self::Hills => "hills",
            Self::LinearSpeed => "linear-speed",
            Self::Cylinder => "cylinder",
            Self::SphereCap => "sphere-cap",
            Self::RandomSpeed => "random-speed",
            Self::Rotating => "rotating",
            Self::Maze => "maze",
            Self::Spiral => "spiral",
        })
    }
}

impl FromStr for Problem {
    type Err = String;

    fn from_str(name: &str) -> std::result::Result<Self, String> {
        const NAMED: [Problem; 9] = [
            Problem::Diffeomorphism,
            Problem::Hills,
            Problem::LinearSpeed,
            Problem::Cylinder,
            Problem::SphereCap,
            Problem::RandomSpeed,
            Problem::Rotating,
            Problem::Maze,
            Problem::Spiral,
        ];
        let constant = name.strip_prefix("constant-").and_then(|ratio| ratio.parse().ok());
        let constant = constant.filter(|ratio| *ratio >= 1.0).map(|ratio| Self::Constant { ratio });
        constant.or_else(|| NAMED.into_iter().find(|known| known.to_string() == name)).ok_or_else(
            || {
                let names = NAMED.map(|known| known.to_string()).join(", ");
                format!("the problems are constant-RATIO (RATIO >= 1), {names}")
            },
        )
    }
}

fn isotropic(speed: f64) -> Sym2 {
    Sym2::new(speed * speed, 0.0, speed * speed)
}

/// Of the two principal speeds, the larger is 1.
pub(crate) fn constant(ratio: f64) -> Sym2 {
    let along = DVec2::from_angle(FRAC_PI_6);
    Sym2::outer(along) + Sym2::outer(along.perp()) * ratio.recip()
}

/// How far the map of [`Problem::Diffeomorphism`] shifts points.
pub(crate) const WARP: f64 = 0.1;

fn diffeomorphism(at: DVec2) -> Sym2 {
    // Φ = [1 a; b 1]
    let (a, b) = (WARP * TAU * (TAU * at.y).cos(), WARP * TAU * (TAU * at.x).cos());
    Sym2::new(1.0 + b * b, a + b, 1.0 + a * a).inverse()
}

fn rotating(at: DVec2) -> Sym2 {
    const RATIO: f64 = 100.0;
    let along = DVec2::from_angle(3.0 * (2.0 * at.x).sin() + 4.0 * (3.0 * at.y).cos());
    Sym2::outer(along) + Sym2::outer(along.perp()) * RATIO.recip()
}

/// The terrain is `SIDE` metres wide; the tensor is that of its metres, and so is the unit of distance.
fn hills(at: DVec2) -> Sym2 {
    const SIDE: f64 = 100.0;
    const DELTA: f64 = 0.01;
    // Centre x and y, height, standard deviation, in metres.
    const HILLS: [[f64; 4]; 5] = [
        [28.0, 30.0, 12.0, 9.0],
        [70.0, 26.0, 8.0, 12.0],
        [62.0, 68.0, 15.0, 11.0],
        [24.0, 74.0, 6.0, 15.0],
        [47.0, 44.0, 5.0, 6.0],
    ];
    let at = SIDE * (at + DVec2::splat(0.5));
    let mut jet = HeightJet::default();
    for [x, y, height, sigma] in HILLS {
        let u = (at - DVec2::new(x, y)) / sigma;
        let z = height * (-0.5 * u.length_squared()).exp();
        jet.z += z;
        jet.zx -= z * u.x / sigma;
        jet.zy -= z * u.y / sigma;
        jet.zxx += z * (u.x * u.x - 1.0) / (sigma * sigma);
        jet.zxy += z * u.x * u.y / (sigma * sigma);
        jet.zyy += z * (u.y * u.y - 1.0) / (sigma * sigma);
    }
    let bend = jet.curvature();
    let [first, second] =
        [0, 1].map(|i| Sym2::outer(bend.directions[i]) * (DELTA + bend.principal[i].abs()).recip());
    (first + second) * (SIDE * SIDE).recip()
}

/// `c = 10^s`, `s` in −1 to 1 a sum of waves of random direction, length and phase.
fn random_speed() -> impl Fn(DVec2) -> Sym2 + Sync {
    const WAVES: usize = 40;
    let mut random = Random(7);
    let waves: Vec<(DVec2, f64)> = (0..WAVES)
        .map(|_| {
            let frequency = 4.0 + 28.0 * random.share();
            (frequency * DVec2::from_angle(TAU * random.share()), TAU * random.share())
        })
        .collect();
    move |at| {
        let sum: f64 = waves.iter().map(|(wave, phase)| (wave.dot(at) + phase).cos()).sum();
        // The sum has standard deviation √(WAVES/2).
        let exponent = 0.5 * sum / (0.5 * WAVES as f64).sqrt();
        isotropic(10_f64.powf(exponent.clamp(-1.0, 1.0)))
    }
}

/// The curvature tensor of heights that are sampled and fitted as a user's are.
fn fitted(n: usize, height: impl Fn(DVec2) -> f64, control: &Control) -> Result<TensorField> {
    let step = 1.0 / (n - 1) as f64;
    let frame = GridFrame::new(n, n, DVec2::new(-0.5, 0.5), DVec2::splat(step), Ground::METRES)?;
    let nodes = (0..n * n).map(|i| DVec2::new((i % n) as f64, (i / n) as f64));
    let heights = nodes.map(|node| height(frame.to_map(node))).collect();
    let terrain = Terrain::new(frame, heights, Crs::none())?;
    let options = FitOptions { smoothing: Smoothing::Interpolate, ..FitOptions::default() };
    let surface = HeightSurface::fit(&terrain, &options, control)?;
    let metric = Curvature { delta: Delta::Absolute(DELTA) }.on(
        &surface,
        &Modifiers::default(),
        &Control::default(),
    )?;
    TensorField::sample(&metric, control)
}

/// Xorshift (Marsaglia 2003): small, and the same on every machine.
struct Random(u64);

impl Random {
    /// Uniform in 0 to 1, 1 excluded.
    fn share(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn below(&mut self, count: usize) -> usize {
        (self.share() * count as f64) as usize
    }
}
