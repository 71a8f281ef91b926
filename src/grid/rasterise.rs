//! The cells that geometry touches.

use std::convert::Infallible;
use std::ops::RangeInclusive;

use glam::DVec2;

use super::frame::GridFrame;
use super::shapes::{Shapes, nodes_inside};
use super::tiling::Tiling;

/// Marks, row-major, every cell that the shapes touch. The cells that a line runs through are connected by their sides, so that no step between
/// neighbouring nodes, diagonal steps included, can cross the line between them.
///
/// On a periodic grid shapes go on over the seam: column `cols` is column 0.
#[must_use]
pub fn rasterise(frame: &GridFrame, shapes: &Shapes) -> Vec<bool> {
    let mut cells = Cells { frame, touched: vec![false; frame.nodes()] };
    for turn in turns(frame, shapes) {
        let start = DVec2::new(f64::from(turn) * frame.cols() as f64, 0.0);
        let Ok(shifted) = shapes.clone().try_map(|at| Ok::<_, Infallible>(at - start));
        cells.touch_all(&shifted);
    }
    cells.touched
}

/// The turns around a periodic grid in which shapes have cells, counted from its first column; 0 on others.
fn turns(frame: &GridFrame, shapes: &Shapes) -> RangeInclusive<i32> {
    /// Nothing real goes around more often.
    const MOST: f64 = 64.0;
    if !frame.is_periodic() {
        return 0..=0;
    }
    let turn = |at: DVec2| ((at.x + 0.5) / frame.cols() as f64).floor().clamp(-MOST, MOST) as i32;
    let (west, east) =
        shapes.vertices().map(turn).fold((0, 0), |(a, b), turn| (a.min(turn), b.max(turn)));
    west..=east
}

struct Cells<'a> {
    frame: &'a GridFrame,
    touched: Vec<bool>,
}

impl Cells<'_> {
    fn touch_all(&mut self, shapes: &Shapes) {
        shapes.points.iter().for_each(|&point| self.touch_along(point, point));
        shapes.segments().for_each(|[a, b]| self.touch_along(a, b));
        // Of polygons also the cells whose centres lie inside.
        let tiling = Tiling::new(self.frame.cols(), self.frame.rows());
        for polygon in &shapes.polygons {
            nodes_inside(polygon, &tiling, |col, row| {
                self.touched[self.frame.index(col, row)] = true;
            });
        }
    }

    /// Marks the cells along a segment, walking from cell to cell through their sides: Amanatides & Woo, A Fast Voxel Traversal
    /// Algorithm for Ray Tracing, Eurographics 1987.
    fn touch_along(&mut self, a: DVec2, b: DVec2) {
        let size = DVec2::new(self.frame.cols() as f64, self.frame.rows() as f64);
        // From here on the corners of cells, not their centres, have integer coordinates.
        let Some((a, b)) = clip(a + 0.5, b + 0.5, size) else { return };
        let (mut cell, last, along) = (a.floor(), b.floor(), b - a);
        let forward = DVec2::select(along.cmpge(DVec2::ZERO), DVec2::ONE, DVec2::NEG_ONE);
        self.touch(cell);
        while cell != last {
            // The parameters at which the segment leaves the cell through its sides ahead in x and in y.
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
    // The clamp removes the rounding error of `a + along * t`.
    let at = |t: f64| (a + along * t).clamp(DVec2::ZERO, size);
    (along.is_finite() && enter <= leave).then(|| (at(enter), at(leave)))
}

#[cfg(test)]
mod tests {
    use geo_types::{Geometry, LineString, MultiPoint, Polygon};

    use super::*;
    use crate::grid::Ground;

    fn picture(cols: usize, rows: usize, geometry: impl Into<Geometry<f64>>) -> Vec<String> {
        let frame = GridFrame::new(cols, rows, DVec2::ZERO, DVec2::ONE, Ground::METRES).unwrap();
        rasterise(&frame, &Shapes::from(geometry))
            .chunks(cols)
            .map(|row| row.iter().map(|&t| if t { '#' } else { '.' }).collect())
            .collect()
    }

    fn line(points: &[(f64, f64)]) -> LineString<f64> {
        points.to_vec().into()
    }

    #[test]
    fn lines_are_connected_by_sides() {
        let drawn = picture(5, 4, line(&[(-9.0, -6.0), (0.0, 0.0), (3.0, 2.0), (300.0, 200.0)]));
        assert_eq!(drawn, ["##...", ".##..", "..###", "....#"].map(String::from));
    }

    #[test]
    fn diagonal_lines_do_not_leak() {
        let drawn = picture(4, 4, line(&[(0.0, 0.0), (3.0, 3.0)]));
        let joined = (0..3)
            .all(|i| drawn[i + 1].as_bytes()[i] == b'#' || drawn[i].as_bytes()[i + 1] == b'#');
        assert!(joined, "{drawn:?}");
    }

    #[test]
    fn areas_are_filled_and_keep_their_holes() {
        let outer = line(&[(0.0, 0.0), (6.0, 0.0), (6.0, 6.0), (0.0, 6.0), (0.0, 0.0)]);
        let hole = line(&[(2.0, 2.0), (4.0, 2.0), (4.0, 4.0), (2.0, 4.0), (2.0, 2.0)]);
        let drawn = picture(8, 7, Polygon::new(outer, vec![hole]));
        assert_eq!(drawn[0], "#######.");
        assert_eq!(drawn[3], "###.###.");
        assert_eq!(drawn[6], "#######.");
    }

    #[test]
    fn shapes_go_on_over_the_seam_of_a_periodic_grid() {
        let origin = DVec2::new(-150.0, 20.0);
        let frame = GridFrame::new(6, 3, origin, DVec2::new(60.0, 20.0), Ground::WGS84).unwrap();
        let touched = |geometry: Geometry<f64>| -> String {
            let cells = rasterise(&frame, &Shapes::from(geometry));
            cells[6..12].iter().map(|&t| if t { '#' } else { '.' }).collect()
        };
        assert_eq!(touched(line(&[(4.0, 1.0), (7.0, 1.0)]).into()), "##..##");
        assert_eq!(touched(line(&[(-1.0, 1.0), (-2.0, 1.0)]).into()), "....##");
        let area = line(&[(4.6, 0.0), (6.2, 0.0), (6.2, 2.0), (4.6, 2.0), (4.6, 0.0)]);
        assert_eq!(touched(Polygon::new(area, vec![]).into()), "#....#");
        assert_eq!(touched(line(&[(-1000.0, 1.0), (0.0, 1.0)]).into()), "######");
        touched(line(&[(-1e300, 1e300), (1e300, 1.0)]).into());
    }

    #[test]
    fn far_and_outside_shapes_are_harmless() {
        let far = line(&[(-1e300, 1e300), (1e300, 1e300), (1e300, -1e300), (-1e300, 1e300)]);
        let points = MultiPoint::from(vec![(-7.0, -7.0), (1e18, 1e18)]);
        let outside = line(&[(-5.0, -1.0), (9.0, -1.0)]);
        let all: [Geometry<f64>; 4] =
            [points.into(), far.clone().into(), outside.into(), Polygon::new(far, vec![]).into()];
        picture(3, 2, Geometry::GeometryCollection(all.to_vec().into()));
    }
}
