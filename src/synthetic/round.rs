//! A trough and a dome: parts of a cylinder and of a sphere, on which distances are known exactly.

use glam::{DVec2, DVec3};

use super::scalar::Scalar;
use super::shape::{Parameters, Shape};

pub(super) const CYLINDER: Shape = Shape {
    name: "cylinder",
    description: "trough with a circular cross-section; distances known exactly",
    default_relief: 0.5,
    round: true,
    height: cylinder,
    jet: cylinder,
};

pub(super) const SPHERE: Shape = Shape {
    name: "sphere",
    description: "dome, the cap of a sphere; distances known exactly",
    default_relief: 0.5,
    round: true,
    height: sphere,
    jet: sphere,
};

fn cylinder<T: Scalar>(p: &Parameters, x: T, _: T) -> T {
    arc(p.arc_curvature(), x * x)
}

fn sphere<T: Scalar>(p: &Parameters, x: T, y: T) -> T {
    -arc(p.arc_curvature(), x * x + y * y) + p.relief
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
}
