//! The cells that points, lines and areas touch.

use glam::DVec2;
use ridgeway::{GridFrame, StartRegion};

/// Marks, row-major, every cell that `shapes` touch: the cells a line runs through are joined by
/// their sides, so no step between neighbours, diagonal ones included, slips through them.
pub(crate) fn cover(frame: &GridFrame, shapes: &StartRegion) -> Vec<bool> {
    let mut cells = Cells { frame, touched: vec![false; frame.nodes()] };
    shapes.points.iter().for_each(|&point| cells.segment(point, point));
    shapes.lines.iter().for_each(|line| cells.polyline(line));
    shapes.areas.iter().flatten().for_each(|ring| cells.polyline(ring));
    // And those whose centre lies inside.
    shapes.nodes_inside(frame.cols(), frame.rows(), |col, row| {
        cells.touched[frame.index(col, row)] = true;
    });
    cells.touched
}

struct Cells<'a> {
    frame: &'a GridFrame,
    touched: Vec<bool>,
}

impl Cells<'_> {
    fn polyline(&mut self, line: &[DVec2]) {
        line.windows(2).for_each(|ends| self.segment(ends[0], ends[1]));
    }

    /// Walks from cell to cell through their sides: Amanatides & Woo, A Fast Voxel Traversal
    /// Algorithm for Ray Tracing, Eurographics 1987.
    fn segment(&mut self, a: DVec2, b: DVec2) {
        let size = DVec2::new(self.frame.cols() as f64, self.frame.rows() as f64);
        // From here on a cell's corner, not its centre, has whole coordinates.
        let Some((a, b)) = clip(a + 0.5, b + 0.5, size) else { return };
        let (mut cell, last, along) = (a.floor(), b.floor(), b - a);
        let forward = DVec2::select(along.cmpge(DVec2::ZERO), DVec2::ONE, DVec2::NEG_ONE);
        self.touch(cell);
        while cell != last {
            // Share of the segment at which it leaves the cell through the side ahead of it.
            let leaves = (cell + forward.max(DVec2::ZERO) - a) / along;
            if cell.y == last.y || (cell.x != last.x && leaves.x < leaves.y) {
                cell.x += forward.x;
            } else {
                cell.y += forward.y;
            }
            self.touch(cell);
        }
    }

    fn touch(&mut self, cell: DVec2) {
        let (col, row) = (cell.x as usize, cell.y as usize);
        if cell.min_element() >= 0.0 && col < self.frame.cols() && row < self.frame.rows() {
            self.touched[self.frame.index(col, row)] = true;
        }
    }
}

/// The part of a segment within `[0, size]` (Liang and Barsky 1984).
fn clip(a: DVec2, b: DVec2, size: DVec2) -> Option<(DVec2, DVec2)> {
    let along = b - a;
    let (mut enter, mut leave) = (0f64, 1f64);
    for (start, step, size) in [(a.x, along.x, size.x), (a.y, along.y, size.y)] {
        if step == 0.0 {
            if !(0.0..=size).contains(&start) {
                return None;
            }
        } else {
            let (one, other) = (-start / step, (size - start) / step);
            enter = enter.max(one.min(other));
            leave = leave.min(one.max(other));
        }
    }
    // The clamp takes the rounding of `a + along * t`.
    let at = |t: f64| (a + along * t).clamp(DVec2::ZERO, size);
    (along.is_finite() && enter <= leave).then(|| (at(enter), at(leave)))
}

#[cfg(test)]
mod tests {
    use ridgeway::Ground;

    use super::*;

    fn picture(cols: usize, rows: usize, shapes: &StartRegion) -> Vec<String> {
        let frame = GridFrame::new(cols, rows, DVec2::ZERO, DVec2::ONE, Ground::METRES).unwrap();
        cover(&frame, shapes)
            .chunks(cols)
            .map(|row| row.iter().map(|&t| if t { '#' } else { '.' }).collect())
            .collect()
    }

    fn line(points: &[(f64, f64)]) -> Vec<DVec2> {
        points.iter().map(|&p| p.into()).collect()
    }

    #[test]
    fn lines_are_joined_by_sides() {
        let lines = vec![line(&[(-9.0, -6.0), (0.0, 0.0), (3.0, 2.0), (300.0, 200.0)])];
        let drawn = picture(5, 4, &StartRegion { lines, ..Default::default() });
        assert_eq!(drawn, ["##...", ".##..", "..###", "....#"].map(String::from));
    }

    #[test]
    fn diagonal_lines_do_not_leak() {
        let lines = vec![line(&[(0.0, 0.0), (3.0, 3.0)])];
        let drawn = picture(4, 4, &StartRegion { lines, ..Default::default() });
        let joined = (0..3)
            .all(|i| drawn[i + 1].as_bytes()[i] == b'#' || drawn[i].as_bytes()[i + 1] == b'#');
        assert!(joined, "{drawn:?}");
    }

    #[test]
    fn areas_are_filled_and_keep_their_holes() {
        let outer = line(&[(0.0, 0.0), (6.0, 0.0), (6.0, 6.0), (0.0, 6.0), (0.0, 0.0)]);
        let hole = line(&[(2.0, 2.0), (4.0, 2.0), (4.0, 4.0), (2.0, 4.0), (2.0, 2.0)]);
        let drawn =
            picture(8, 7, &StartRegion { areas: vec![vec![outer, hole]], ..Default::default() });
        assert_eq!(drawn[0], "#######.");
        assert_eq!(drawn[3], "###.###.");
        assert_eq!(drawn[6], "#######.");
    }

    #[test]
    fn far_and_outside_shapes_are_harmless() {
        let far = line(&[(-1e300, 1e300), (1e300, 1e300), (1e300, -1e300), (-1e300, 1e300)]);
        let shapes = StartRegion {
            points: vec![DVec2::splat(-7.0), DVec2::splat(1e18)],
            lines: vec![far.clone(), line(&[(-5.0, -1.0), (9.0, -1.0)])],
            areas: vec![vec![far]],
            ..StartRegion::default()
        };
        picture(3, 2, &shapes);
    }
}
