//! The update of one node in plain form: for the reference solver, and for the step back along a route.

use glam::DVec2;

use super::UNREACHED;
use super::ring::{RING, TRIANGLES, without_cut_corners};
use super::segment::weighted_segment;
use crate::linalg::Sym2;

/// What steps from a node to its ring cost: the metric in each of the [`TRIANGLES`], `None` beyond the grid, and the costs on the ring and
/// at the node.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Steps {
    pub(crate) metrics: [Option<Sym2>; 8],
    pub(crate) ring: [f64; 8],
    pub(crate) own: f64,
}

/// Where a value comes from.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Foot {
    /// The value.
    pub(crate) value: f64,
    /// The ends of a segment as places on the ring, and the share of the second in the point that the value comes from.
    pub(crate) ends: [usize; 2],
    pub(crate) theta: f64,
}

impl Foot {
    /// The step to the point.
    pub(crate) fn step(&self) -> DVec2 {
        let [a, b] = self.ends.map(on_ring);
        a.lerp(b, self.theta)
    }
}

/// The least value of a node over its ring, and the point of the ring that it came from, its foot; `None` if
/// nothing around is reached. `ring` are the values there, to each of which its factoring term is added.
pub(crate) fn best_foot(ring: [f32; 8], terms: [f64; 8], steps: &Steps) -> Option<Foot> {
    let ring = without_cut_corners(ring);
    let mut best: Option<Foot> = None;
    for (t, metric) in TRIANGLES.iter().zip(steps.metrics) {
        let Some(metric) = metric else { continue };
        let ends = [t.a, t.b];
        let [ga, gb] = ends.map(|k| f64::from(ring[k]) + terms[k]);
        // The minimum over a segment is no less than the smaller of its two values.
        if best.is_some_and(|best| ga.min(gb) >= best.value) {
            continue;
        }
        let [a, b] = ends.map(on_ring);
        let mut offer = |theta: f64| {
            let cost =
                0.5 * (steps.own + (1.0 - theta) * steps.ring[t.a] + theta * steps.ring[t.b]);
            let cost = match theta {
                0.0 => 0.5 * (steps.own + steps.ring[t.a]),
                1.0 => 0.5 * (steps.own + steps.ring[t.b]),
                _ => cost,
            };
            let value = match theta {
                0.0 => ga,
                1.0 => gb,
                _ => ga + theta * (gb - ga),
            } + cost * metric.norm(a.lerp(b, theta));
            if best.is_none_or(|best| value < best.value) {
                best = Some(Foot { value, ends, theta });
            }
        };
        let [is_a, is_b] = ends.map(|k| ring[k] < UNREACHED);
        if is_a {
            offer(0.0);
        }
        if is_b {
            offer(1.0);
        }
        if is_a && is_b {
            let costs = [steps.own, steps.ring[t.a], steps.ring[t.b]];
            offer(weighted_segment([ga, gb], [a, b], metric, costs));
        }
    }
    best
}

/// The step to a place on the ring.
fn on_ring(place: usize) -> DVec2 {
    let (x, y) = RING[place];
    DVec2::new(x.into(), y.into())
}
