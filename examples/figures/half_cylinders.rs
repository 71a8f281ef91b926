//! Figure 8: two half-cylinders of different radius that meet along a seam, divided between two seeds.

use std::f64::consts::PI;

use glam::{DVec2, DVec3};
use ridgeway::{
    Control, DistanceMap, Jet, Metric, Modifiers, Result, Solver, StartRegion, Stop, Surface,
    SurfaceJet,
};

/// Radii of the arch and of the trough that it goes over into, with one tangent plane along the seam.
const RADII: [f64; 2] = [1.0, 2.0];
/// Length of the axes.
const LENGTH: f64 = 6.0;
/// Places of the seeds as shares of their own half's arc and of the length: both are given, neither lies well.
const SEEDS: [[f64; 2]; 2] = [[0.25, 0.25], [0.25, 0.75]];

/// An arch and a trough; columns go along the arcs, rows along the axes.
pub(crate) struct HalfCylinders {
    pub(crate) nodes: usize,
}

impl HalfCylinders {
    /// Grid coordinates of a point at length `arc` along the arcs and `axis` along the axes.
    fn grid(&self, arc: f64, axis: f64) -> DVec2 {
        let last = (self.nodes - 1) as f64;
        DVec2::new(arc / (PI * (RADII[0] + RADII[1])), axis / LENGTH) * last
    }

    /// The column of the seam, in general between two nodes.
    pub(crate) fn seam(&self) -> f64 {
        self.grid(PI * RADII[0], 0.0).x
    }

    /// Seeds in the first and in the second half.
    pub(crate) fn seeds(&self) -> [DVec2; 2] {
        let [[a, b], [c, d]] = SEEDS;
        let [first, second] = RADII;
        [self.grid(a * PI * first, b * LENGTH), self.grid(PI * first + c * PI * second, d * LENGTH)]
    }
}

impl Surface for HalfCylinders {
    fn cols(&self) -> usize {
        self.nodes
    }

    fn rows(&self) -> usize {
        self.nodes
    }

    fn jet(&self, at: DVec2) -> Jet {
        let step = 1.0 / self.grid(1.0, 1.0);
        let (arc, [first, second]) = (at.x * step.x, RADII);
        // Radius, length since the half began, centre, and whether it bends up.
        let (radius, along, centre, up) = if arc < PI * first {
            (first, arc, first, 1.0)
        } else {
            (second, arc - PI * first, 2.0 * first + second, -1.0)
        };
        let (sin, cos) = (along / radius).sin_cos();
        let outward = DVec3::new(-cos, 0.0, up * sin);
        Jet::Space(SurfaceJet {
            point: DVec3::new(centre, at.y * step.y, 0.0) + outward * radius,
            first: [DVec3::new(sin, 0.0, up * cos) * step.x, DVec3::Y * step.y],
            second: [outward * -(step.x * step.x / radius), DVec3::ZERO, DVec3::ZERO],
        })
    }
}

/// Which half each node falls to, and the share of the nodes that fall to their own.
pub(crate) fn divide(surface: &HalfCylinders, metric: &dyn Metric) -> Result<(Vec<bool>, f64)> {
    let control = Control::default();
    let metric = metric.on(surface, &Modifiers::default(), &control)?;
    let seeds = surface.seeds().map(StartRegion::from);
    let map: DistanceMap = Solver::default().solve(&metric, &seeds, &Stop::Never, &control)?;
    let second: Vec<bool> = map.allocation().iter().map(|&label| label == Some(1)).collect();
    let right = (0..).zip(&second).filter(|(i, second)| {
        let col = i % surface.nodes;
        (col as f64 > surface.seam()) == **second
    });
    let share = right.count() as f64 / second.len() as f64;
    Ok((second, share))
}
