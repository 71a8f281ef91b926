//! The path of nodes: a line that exists wherever there is a value.
//!
//! Each node leads to the end of its ring's segment that its value came from. The line keeps to cheap lines one cell wide, such as roads in a raster of costs,
//! which descent on interpolated distances leaves; on smooth ground it is up to a twelfth too long, which polishing mends.

use std::collections::HashSet;

use glam::DVec2;

use crate::eikonal::{DistanceMap, has_line_of_sight};

/// The line over nodes from the start region to `goal`, in grid coordinates; `None` if no reached corner of its cell is in sight.
pub(super) fn line(distance: &DistanceMap, goal: DVec2) -> Option<Vec<DVec2>> {
    let mut line = vec![goal];
    let mut at = if goal == goal.round() { goal } else { distance.lowest_corner(goal)?.0 };
    let mut seen = HashSet::new();
    while seen.insert([at.x as isize, at.y as isize]) {
        if at != goal {
            line.push(at);
        }
        let value = distance.reached(at.x as isize, at.y as isize)?;
        if let Some(start) = distance.straight_foot(at, value) {
            return Some(closed(line, start));
        }
        let Some(next) = predecessor(distance, at, value) else { break };
        at = next;
    }
    // Around the start of an anisotropic distance no node may be lower; then the way is straight.
    let start = distance.factor_point_in_sight(*line.last()?)?;
    Some(closed(line, start))
}

/// The node from which that at `at` has most of its value, of those that are lower if there are any.
fn predecessor(distance: &DistanceMap, at: DVec2, value: f64) -> Option<DVec2> {
    let foot = at + distance.foot(at.x as isize, at.y as isize)?;
    let rank = |node: DVec2| {
        let g = distance.reached(node.x as isize, node.y as isize)?;
        has_line_of_sight(&distance.field, at, node).then_some((
            g >= value,
            node.distance(foot),
            node,
        ))
    };
    let ends = [foot.floor(), foot.ceil()].into_iter().filter_map(rank);
    ends.min_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1))).map(|(.., node)| node)
}

/// The line to its start, turned round; at least two points.
fn closed(mut line: Vec<DVec2>, start: DVec2) -> Vec<DVec2> {
    if line.last() != Some(&start) || line.len() == 1 {
        line.push(start);
    }
    line.reverse();
    line
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::control::Control;
    use crate::eikonal::{Solver, Stop, TensorField};
    use crate::linalg::Sym2;

    #[test]
    fn early_stops_keep_a_line_to_every_goal_on_any_constant_tensor() {
        let (control, start) = (Control::default(), DVec2::new(23.0, 32.0));
        for (ratio, angle) in [(4.0, 0.3), (200.0, 1.1), (1e4, 0.03), (1e4, 1.57)] {
            let along = DVec2::from_angle(angle);
            let d = Sym2::outer(along) * ratio + Sym2::outer(along.perp());
            let field = || TensorField::from_fn(50, 40, |_, _| Some(d), &control).unwrap();
            let solve = |stop| {
                Solver::default().solve_field(field(), &[start.into()], &stop, &control).unwrap()
            };
            let whole = solve(Stop::Never);
            for k in 0..49 {
                let goal = start + DVec2::new(f64::from(k % 7) - 3.0, f64::from(k / 7) - 3.0) * 2.0;
                let stopped = solve(Stop::AllGoals(vec![goal]));
                let (g, expected) = (
                    stopped.at_node(goal.x as usize, goal.y as usize),
                    whole.at_node(goal.x as usize, goal.y as usize),
                );
                assert!(
                    (g - expected).abs() <= 1e-3 * expected,
                    "{ratio} {angle} {goal}: {g}, {expected}"
                );
                let line = line(&stopped, goal).unwrap();
                assert_eq!((line[0], line[line.len() - 1]), (start, goal));
            }
        }
    }
}
