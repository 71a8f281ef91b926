//! The update of one node in plain form: for the reference solver, and for the step back along a route.

use glam::DVec2;

use super::UNREACHED;
use super::ring::{RING, Triangle, without_cut_corners};
use super::segment::segment;
use crate::linalg::Sym2;

/// The least value of a node over its ring, and the step to the point of the ring that it came from, its foot; `None` if
/// nothing around is reached. `ring` are the values there, to each of which its factoring term is added.
pub(crate) fn best_foot(ring: [f32; 8], terms: [f64; 8], metric: Sym2) -> Option<(f64, DVec2)> {
    let ring = without_cut_corners(ring);
    let at = |k: usize| DVec2::new(RING[k].0.into(), RING[k].1.into());
    let mut best: Option<(f64, DVec2)> = None;
    for axis in [0, 2, 4, 6] {
        for diagonal in [axis + 1, (axis + 7) % 8] {
            let Triangle { a, b, .. } = Triangle::new(axis, diagonal);
            let (ga, gb) = (f64::from(ring[a]) + terms[a], f64::from(ring[b]) + terms[b]);
            // The minimum over a segment is no less than the smaller of its two values.
            if best.is_some_and(|(least, _)| ga.min(gb) >= least) {
                continue;
            }
            let (value, foot) = match (ring[a] < UNREACHED, ring[b] < UNREACHED) {
                (true, true) => {
                    let (value, theta) = segment(ga, at(a), gb, at(b), metric);
                    (value, at(a).lerp(at(b), theta))
                }
                (true, false) => (ga + metric.norm(at(a)), at(a)),
                (false, true) => (gb + metric.norm(at(b)), at(b)),
                (false, false) => continue,
            };
            if best.is_none_or(|(least, _)| value < least) {
                best = Some((value, foot));
            }
        }
    }
    best
}
