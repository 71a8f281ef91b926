//! Descent on the distance: the line of a route.
//!
//! Away from walls the line follows the solver's own directions, interpolated between the nodes, with the midpoint
//! rule; the deviation from the exact line is set by the error of the distance, not by the step. Where that does
//! not descend, next to walls and on the cut locus, it goes through the cell's border to the best point there,
//! by the same update as the solver; and where even that does not descend, from node to node, each to the point
//! that gave it its value, which cannot fail.

use glam::DVec2;

use crate::eikonal::DistanceMap;
use crate::linalg::bilinear::{CORNERS, corner_weights};

/// Step of the midpoint rule in cells. A half or a quarter, and fourth order, give the same lines.
const STEP: f64 = 0.5;

/// The line from the start region to `goal` in grid coordinates; `None` if the goal was not reached.
pub(super) fn line(distance: &DistanceMap, goal: DVec2) -> Option<Vec<DVec2>> {
    let mut value = distance.stored_at(goal)?;
    let mut at = goal;
    let mut line = vec![goal];
    let start = loop {
        if let Some(foot) = distance.straight_foot(at, value) {
            break foot;
        }
        let next = follow(distance, at, value)
            .or_else(|| distance.descend_to_border(at, value))
            .or_else(|| descend_to_node(distance, at));
        match next {
            Some((next, lower)) if lower < value => (at, value) = (next, lower),
            // Near the start an anisotropic distance may have no lower node in reach.
            _ => break distance.factor_point_in_sight(at)?,
        }
        line.push(at);
    };
    // Straight to the start in such steps too; a single one, of no length, if the goal is on the start.
    let steps = (at.distance(start) / STEP).ceil().max(1.0);
    line.extend((1..steps as usize).map(|i| at.lerp(start, i as f64 / steps)));
    if start != at || line.len() == 1 {
        line.push(start);
    }
    line.reverse();
    Some(line)
}

/// One step of the midpoint rule along the interpolated directions, if it stays clear of walls and descends.
fn follow(distance: &DistanceMap, at: DVec2, value: f64) -> Option<(DVec2, f64)> {
    let middle = at + 0.5 * STEP * direction(distance, at)?;
    let next = at + STEP * direction(distance, middle)?;
    clear_cell(distance, next)?;
    let lower = distance.stored_at(next)?;
    // At least a tenth of what the step should bring, so that steps cannot dwindle.
    let expected = distance.field.metric_at(at)?.norm(next - at);
    (lower <= value - 0.1 * expected).then_some((next, lower))
}

/// Unit vector of descent in grid coordinates, bilinear between the corners of the cell.
fn direction(distance: &DistanceMap, at: DVec2) -> Option<DVec2> {
    let (col, row) = clear_cell(distance, at)?;
    let weights = corner_weights(at - DVec2::new(col as f64, row as f64));
    let mut sum = DVec2::ZERO;
    for ((i, j), weight) in CORNERS.into_iter().zip(weights) {
        if weight > 0.0 {
            sum += weight * distance.foot(col + i, row + j)?.try_normalize()?;
        }
    }
    sum.try_normalize()
}

/// The cell of a point, if the point is inside the grid and all corners that matter are reached.
fn clear_cell(distance: &DistanceMap, at: DVec2) -> Option<(isize, isize)> {
    if !distance.field.tiling.contains(at) {
        return None;
    }
    let (col, row) = (at.x.floor() as isize, at.y.floor() as isize);
    let (east, south) = (at.x > col as f64, at.y > row as f64);
    let reached =
        |i: bool, j: bool| distance.reached(col + isize::from(i), row + isize::from(j)).is_some();
    let clear = reached(false, false)
        && (!east || reached(true, false))
        && (!south || reached(false, true))
        && (!(east && south) || reached(true, true));
    clear.then_some((col, row))
}

/// From a node to the point its value came from; from elsewhere to the lowest corner in sight.
fn descend_to_node(distance: &DistanceMap, at: DVec2) -> Option<(DVec2, f64)> {
    if at == at.round() {
        let next = at + distance.foot(at.x as isize, at.y as isize)?;
        return Some((next, distance.stored_at(next)?));
    }
    distance.lowest_corner(at)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::control::Control;
    use crate::eikonal::{Solver, StartRegion, Stop, TensorField};
    use crate::linalg::Sym2;

    fn solve(
        n: usize,
        start: DVec2,
        tensor: impl Fn(usize, usize) -> Option<Sym2> + Sync,
    ) -> DistanceMap {
        let field = TensorField::from_fn(n, n, tensor, &Control::default()).unwrap();
        Solver::default()
            .solve_field(field, &[start.into()], &Stop::Never, &Control::default())
            .unwrap()
    }

    fn check(distance: &DistanceMap, start: DVec2, goal: DVec2) -> Vec<DVec2> {
        let line = line(distance, goal).unwrap();
        assert_eq!((line[0], line[line.len() - 1]), (start, goal));
        for ends in line.windows(2) {
            let (a, b) =
                (distance.stored_at(ends[0]).unwrap(), distance.stored_at(ends[1]).unwrap());
            assert!(a < b, "{} {a} is not nearer than {} {b}", ends[0], ends[1]);
            assert!(ends[0].distance(ends[1]) <= 1.5);
        }
        line
    }

    #[test]
    fn lines_on_a_constant_tensor_are_straight() {
        for ratio in [1.0, 4.0, 25.0] {
            let (sin, cos) = 0.5f64.sin_cos();
            let d = Sym2::outer(DVec2::new(cos, sin)) * ratio + Sym2::outer(DVec2::new(-sin, cos));
            let start = DVec2::new(60.3, 59.6);
            let distance = solve(121, start, |_, _| Some(d));
            for k in 0..40 {
                let goal = start + 55.0 * DVec2::from_angle(0.157 * f64::from(k));
                let along = (goal - start).normalize();
                let line = check(&distance, start, goal);
                let stray =
                    line.iter().map(|p| (*p - start).perp_dot(along).abs()).fold(0.0, f64::max);
                assert!(stray < 1.5, "ratio {ratio}, goal {goal}: {stray} cells");
            }
        }
    }

    #[test]
    fn lines_lead_to_the_start_that_won() {
        let field = TensorField::from_fn(
            81,
            61,
            |_, _| Some(Sym2::new(1.0, 0.0, 1.0)),
            &Control::default(),
        );
        let (near, far) = (DVec2::new(50.2, 30.0), DVec2::new(10.0, 30.7));
        let starts = [StartRegion::from(near).with_value(25.0), StartRegion::from(far)];
        let solver = Solver::default();
        let map =
            solver.solve_field(field.unwrap(), &starts, &Stop::Never, &Control::default()).unwrap();
        // The second start wins where it is less than 25 cells farther away.
        for (goal, home) in [(DVec2::new(40.0, 30.0), far), (DVec2::new(60.0, 33.0), near)] {
            let line = line(&map, goal).unwrap();
            assert_eq!((line[0], line[line.len() - 1]), (home, goal));
        }
    }

    #[test]
    fn lines_go_on_over_the_seam_of_a_closed_surface() {
        let (cols, rows) = (70, 50);
        let d = Sym2::new(1.0, 0.3, 1.5);
        let field = TensorField::from_fn(cols, rows, |_, _| Some(d), &Control::default());
        let field = field.unwrap().periodic([true, true]).unwrap();
        let period = DVec2::new(cols as f64, rows as f64);
        let start = DVec2::new(65.3, 46.6);
        let map = Solver::default()
            .solve_field(field, &[start.into()], &Stop::Never, &Control::default())
            .unwrap();
        for k in 0..40 {
            // Nearer than any image; the line ends at the image of the start that is near the goal.
            let home = start + period * DVec2::new(f64::from(k % 5) - 2.0, f64::from(k % 3) - 1.0);
            let goal = home + 17.0 * DVec2::from_angle(0.157 * f64::from(k));
            let line = line(&map, goal).unwrap();
            assert_eq!(line[line.len() - 1], goal);
            assert!(line[0].distance(home) < 1e-9, "{goal}: {} is not {home}", line[0]);
            let along = (goal - home).normalize();
            for (p, q) in line.iter().zip(&line[1..]) {
                assert!(p.distance(*q) < 1.5 && (*p - home).perp_dot(along).abs() < 0.5, "{p}");
            }
        }
    }

    #[test]
    fn lines_go_round_walls_without_touching_them() {
        // Staggered walls with a gap at alternate ends; one of them is a bare diagonal of nodes.
        let n = 60;
        let wall = |c: usize, r: usize| {
            (r == 15 && c < 50)
                || (r == 30 && c > 10)
                || (c + r == 90 && r > 34 && c > 34 && c < 56)
        };
        let start = DVec2::new(5.0, 3.0);
        let distance = solve(n, start, |c, r| (!wall(c, r)).then_some(Sym2::new(1.0, 0.0, 1.0)));
        for goal in [DVec2::new(40.2, 20.4), DVec2::new(20.5, 55.5), DVec2::new(50.7, 50.2)] {
            let line = check(&distance, start, goal);
            for ends in line.windows(2) {
                assert!(crate::eikonal::has_line_of_sight(&distance.field, ends[0], ends[1]));
            }
        }
    }

    #[test]
    fn lines_descend_on_rough_fields_of_any_anisotropy() {
        let n = 80;
        let random = |c: usize, r: usize, salt: u64| {
            let mut x = (c as u64) << 32 ^ (r as u64) << 8 ^ salt;
            for _ in 0..3 {
                x = (x ^ x >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            }
            (x >> 11) as f64 / (1u64 << 53) as f64
        };
        let tensor = |c, r| {
            let along = DVec2::from_angle(6.3 * random(c, r, 1));
            let d = Sym2::outer(along) + Sym2::outer(along.perp()) * (0.01 + random(c, r, 2));
            (random(c, r, 3) > 0.15).then_some(d)
        };
        let start = DVec2::new(40.0, 40.0);
        let open = |c: usize, r: usize| {
            if (c, r) == (40, 40) { Some(Sym2::new(1.0, 0.0, 1.0)) } else { tensor(c, r) }
        };
        let distance = solve(n, start, open);
        for row in (0..n).step_by(3) {
            for col in (0..n).step_by(3) {
                if distance.is_reached(col, row) && (col, row) != (40, 40) {
                    check(&distance, start, DVec2::new(col as f64, row as f64));
                }
            }
        }
    }
}
