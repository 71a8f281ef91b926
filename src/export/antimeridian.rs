//! Lines and rings that cross 180° of longitude.

use glam::DVec3;

/// Cuts a line (longitude, latitude, height) where it crosses 180°, as RFC 7946 section 3.1.9 asks.
/// Longitudes may be given beyond ±180; two successive ones are taken to go the short way round.
pub(super) fn cut_at_antimeridian(line: &[DVec3]) -> Vec<Vec<DVec3>> {
    let wrap = |p: DVec3| DVec3::new(p.x - 360.0 * (p.x / 360.0).round(), p.y, p.z);
    let mut parts = vec![Vec::new()];
    let mut last: Option<DVec3> = None;
    for here in line.iter().map(|&p| wrap(p)) {
        if let Some(before) = last.filter(|l| (here.x - l.x).abs() > 180.0) {
            // `side` is the edge of the map left through: 180 going east, −180 going west.
            let side = 180f64.copysign(before.x);
            let unwrapped = here + DVec3::new(360f64.copysign(before.x), 0.0, 0.0);
            let t = (side - before.x) / (unwrapped.x - before.x);
            let edge = before.lerp(unwrapped, t);
            parts.last_mut().expect("never empty").push(edge.with_x(side));
            parts.push(vec![edge.with_x(-side)]);
        }
        parts.last_mut().expect("never empty").push(here);
        last = Some(here);
    }
    // A line that only touches 180° leaves a part of no length.
    let has_length = |part: &Vec<DVec3>| part.iter().any(|p| p.truncate() != part[0].truncate());
    if parts.len() > 1 {
        parts.retain(has_length);
    }
    parts
}

/// A ring (longitude, latitude, height) that goes the short way round from each position to the next, beyond ±180 if need be.
pub(super) fn unwrap_ring(mut ring: Vec<DVec3>) -> Vec<DVec3> {
    for i in 1..ring.len() {
        ring[i].x -= 360.0 * ((ring[i].x - ring[i - 1].x) / 360.0).round();
    }
    ring
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn touching_the_date_line_cuts_nothing() {
        let line = [[-179.0, 0.0], [180.0, 0.0], [-179.0, 1.0]];
        let line: Vec<_> = line.iter().map(|p| DVec3::new(p[0], p[1], 0.0)).collect();
        let parts = cut_at_antimeridian(&line);
        assert!(parts.iter().all(|part| part.iter().all(|p| p.x < 0.0)), "{parts:?}");
        assert_eq!(cut_at_antimeridian(&line[..1]).len(), 1);
    }
}
