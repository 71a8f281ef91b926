//! Outlines of regions: polygons with holes along the edges of the cells around the nodes.
//!
//! A cell reaches half a step from its node. Neighbours share every corner of their common border, so that the polygons of a level
//! cover the grid without gaps and overlaps, also on another map.

use std::collections::HashMap;

use geo_types::{Coord, LineString, MultiPolygon, Polygon};
use glam::DVec2;

use super::Level;
use crate::grid::contains;

/// The polygons of each region of a level on a grid of `cols` columns, in grid coordinates (column, row) and the order of [`Level::regions`]. Cells that touch at
/// a corner only are in different polygons. Rings touch each other or themselves in single points at most: exteriors are anticlockwise on a
/// north-up map, holes clockwise (RFC 7946). Cost: about 100 ns per cell of border.
#[must_use]
pub fn outlines(level: &Level, cols: usize) -> Vec<MultiPolygon<f64>> {
    let mut sides = vec![Vec::new(); level.regions.len()];
    let cells = Cells { labels: &level.labels, cols, rows: level.labels.len() / cols.max(1) };
    for (index, label) in level.labels.iter().enumerate() {
        if let Some(label) = label {
            cells.add_sides(index % cols, index / cols, &mut sides[*label as usize]);
        }
    }
    sides
        .into_iter()
        .map(|sides| polygons(rings(sides).iter().map(|ring| cells.corners(ring))))
        .collect()
}

/// The cells of a grid. Their corners are numbered row by row, with `cols + 1` in a row; corner `(0, 0)` is the north-west one of cell `(0, 0)`.
struct Cells<'a> {
    labels: &'a [Option<u32>],
    cols: usize,
    rows: usize,
}

impl Cells<'_> {
    /// Label of the cell in this column and row, counted from 1; `None` also outside.
    fn label(&self, col: usize, row: usize) -> Option<u32> {
        let inside = (1..=self.cols).contains(&col) && (1..=self.rows).contains(&row);
        if inside { self.labels[(row - 1) * self.cols + col - 1] } else { None }
    }

    /// Adds the sides of a cell along other labels, from corner to corner, the cell on the left.
    fn add_sides(&self, col: usize, row: usize, sides: &mut Vec<[usize; 2]>) {
        let own = self.label(col + 1, row + 1);
        let north_west = row * (self.cols + 1) + col;
        let south_west = north_west + self.cols + 1;
        let (north_east, south_east) = (north_west + 1, south_west + 1);
        for (neighbour, side) in [
            (self.label(col + 1, row + 2), [south_west, south_east]),
            (self.label(col + 2, row + 1), [south_east, north_east]),
            (self.label(col + 1, row), [north_east, north_west]),
            (self.label(col, row + 1), [north_west, south_west]),
        ] {
            if neighbour != own {
                sides.push(side);
            }
        }
    }

    /// A ring of corners without those where it runs straight on and only one other label lies along it, as grid
    /// coordinates.
    fn corners(&self, ring: &[usize]) -> LineString<f64> {
        let count = ring.len();
        let kept = (0..count).filter(|&i| {
            let [before, here, after] =
                [ring[(i + count - 1) % count], ring[i], ring[(i + 1) % count]];
            let straight = after.wrapping_sub(here) == here.wrapping_sub(before);
            !straight || self.labels_around(here) > 2
        });
        let mut corners: LineString<f64> = kept.map(|i| self.coordinates(ring[i])).collect();
        corners.close();
        corners
    }

    /// Grid coordinates of a corner.
    fn coordinates(&self, corner: usize) -> Coord<f64> {
        let (col, row) = (corner % (self.cols + 1), corner / (self.cols + 1));
        Coord { x: col as f64 - 0.5, y: row as f64 - 0.5 }
    }

    fn labels_around(&self, corner: usize) -> usize {
        let (col, row) = (corner % (self.cols + 1), corner / (self.cols + 1));
        let mut around =
            [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(i, j)| self.label(col + i, row + j));
        around.sort_unstable();
        1 + around.windows(2).filter(|pair| pair[0] != pair[1]).count()
    }
}

/// Joins sides to rings, none of which comes to a corner twice.
fn rings(mut sides: Vec<[usize; 2]>) -> Vec<Vec<usize>> {
    sides.sort_unstable();
    let mut used = vec![false; sides.len()];
    let mut rings = Vec::new();
    let mut path: Vec<usize> = Vec::new();
    // Where on the path each of its corners is.
    let mut positions = HashMap::new();
    for first in 0..sides.len() {
        let mut next = (!used[first]).then_some(first);
        while let Some(side) = next {
            used[side] = true;
            let [from, to] = sides[side];
            positions.insert(from, path.len());
            path.push(from);
            // The path has come round to a corner: what lies between is a ring.
            if let Some(&start) = positions.get(&to) {
                let ring = path.split_off(start);
                for corner in &ring {
                    positions.remove(corner);
                }
                rings.push(ring);
            }
            let leaving = sides.partition_point(|s| s[0] < to);
            next = (leaving..sides.len())
                .take_while(|&side| sides[side][0] == to)
                .find(|&side| !used[side])
                .filter(|_| !path.is_empty());
        }
    }
    rings
}

/// Gives each hole to the smallest exterior around it.
fn polygons(rings: impl Iterator<Item = LineString<f64>>) -> MultiPolygon<f64> {
    let (mut exteriors, holes): (Vec<_>, Vec<_>) = rings.partition(|ring| area(ring) > 0.0);
    exteriors.sort_by(|a, b| area(a).total_cmp(&area(b)));
    let mut polygons: Vec<_> =
        exteriors.into_iter().map(|exterior| Polygon::new(exterior, Vec::new())).collect();
    for hole in holes {
        let cell = cell_left_of(&hole);
        if let Some(owner) = polygons.iter_mut().find(|polygon| contains(polygon, cell)) {
            owner.interiors_push(hole);
        }
    }
    polygons.into()
}

/// The middle of the cell on the left of the first side of a ring.
fn cell_left_of(ring: &LineString<f64>) -> DVec2 {
    let [from, to] = [ring[0], ring[1]].map(|end| DVec2::new(end.x, end.y));
    let along = (to - from).normalize_or_zero();
    from + 0.5 * (along - along.perp())
}

/// Area in cells; positive if the ring is anticlockwise on a north-up map.
fn area(ring: &LineString<f64>) -> f64 {
    -0.5 * ring.lines().map(|side| side.determinant()).sum::<f64>()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::region::Region;

    /// A level from a picture: a digit is a region, a dot is closed.
    fn level(picture: &str) -> (Level, usize) {
        let cols = picture.lines().next().unwrap().trim().len();
        let labels: Vec<_> =
            picture.lines().flat_map(|line| line.trim().chars().map(|c| c.to_digit(10))).collect();
        let count = labels.iter().flatten().max().map_or(0, |most| most + 1);
        let region = Region { seed: [0, 0], parent: None, epsilon: 1.0 };
        (Level { labels, regions: vec![region; count as usize] }, cols)
    }

    fn rings(polygon: &Polygon<f64>) -> impl Iterator<Item = &LineString<f64>> {
        polygon.interiors().iter().chain([polygon.exterior()])
    }

    fn total_area(polygons: &MultiPolygon<f64>) -> f64 {
        polygons.iter().flat_map(rings).map(area).sum()
    }

    #[test]
    fn polygons_have_the_cells_of_their_regions() {
        let pictures = [
            "0",
            "01\n11",
            "000\n010\n000",
            "00000\n01110\n01010\n01110\n00000",
            // Diagonal neighbours, alone, as holes, and a hole that touches the border.
            "01\n10",
            "0000\n0100\n0010\n0000",
            "100\n010\n000",
            "..0\n.1.\n22.",
        ];
        for picture in pictures {
            let (level, cols) = level(picture);
            for (label, polygons) in outlines(&level, cols).iter().enumerate() {
                let cells = level.labels.iter().filter(|l| **l == Some(label as u32)).count();
                assert_eq!(total_area(polygons), cells as f64, "{picture}: {polygons:?}");
                for polygon in polygons {
                    assert!(area(polygon.exterior()) > 0.0);
                    for ring in rings(polygon) {
                        let mut corners: Vec<_> = ring.0[1..]
                            .iter()
                            .map(|p| [(2.0 * p.x) as i64, (2.0 * p.y) as i64])
                            .collect();
                        assert!(ring.is_closed());
                        corners.sort_unstable();
                        corners.dedup();
                        assert!(corners.len() >= 4 && ring.0.len() > 4, "{picture}: {ring:?}");
                    }
                }
            }
        }
    }

    #[test]
    fn holes_go_to_the_polygon_around_them() {
        let (level, cols) = level("00000\n0...0\n0.0.0\n0...0\n00000");
        let [MultiPolygon(polygons)] = &outlines(&level, cols)[..] else { panic!() };
        assert_eq!(polygons.len(), 2);
        assert_eq!(polygons.iter().map(|p| p.interiors().len()).collect::<Vec<_>>(), [0, 1]);
        let exterior = &polygons[1].exterior().0;
        assert!(exterior.contains(&(-0.5, -0.5).into()));
        assert_eq!(exterior.len(), 5);
    }

    #[test]
    fn neighbours_share_the_corners_of_their_border() {
        let (level, cols) = level("000\n112");
        let meeting = (1.5, 0.5).into();
        for polygons in outlines(&level, cols) {
            assert!(polygons.0[0].exterior().0.contains(&meeting));
        }
    }
}
