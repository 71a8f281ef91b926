//! Points, lines and polygons in grid coordinates.

use std::iter::once;

use geo_types::{Geometry, LineString, Polygon};
use glam::DVec2;

use super::tiling::Tiling;

/// Any geometry of `geo-types` split into points, lines and polygons, in grid coordinates (column, row).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Shapes {
    /// Single points, on nodes or between them.
    pub points: Vec<DVec2>,
    /// Polylines.
    pub lines: Vec<LineString<f64>>,
    /// Areas; a point is inside a polygon if an odd number of its rings surround it.
    pub polygons: Vec<Polygon<f64>>,
}

impl<G: Into<Geometry<f64>>> From<G> for Shapes {
    fn from(geometry: G) -> Self {
        let mut shapes = Self::default();
        shapes.add(geometry.into());
        shapes
    }
}

impl Shapes {
    /// Adds the parts of a geometry.
    pub fn add(&mut self, geometry: Geometry<f64>) {
        match geometry {
            Geometry::Point(point) => self.points.push(vector(point)),
            Geometry::MultiPoint(points) => self.points.extend(points.into_iter().map(vector)),
            Geometry::Line(line) => self.lines.push(line.into()),
            Geometry::LineString(line) => self.lines.push(line),
            Geometry::MultiLineString(lines) => self.lines.extend(lines),
            Geometry::Polygon(polygon) => self.polygons.push(polygon),
            Geometry::MultiPolygon(polygons) => self.polygons.extend(polygons),
            Geometry::Rect(rect) => self.polygons.push(rect.to_polygon()),
            Geometry::Triangle(triangle) => self.polygons.push(triangle.to_polygon()),
            Geometry::GeometryCollection(all) => all.into_iter().for_each(|part| self.add(part)),
        }
    }

    /// The same shapes with every point mapped by `to`.
    ///
    /// # Errors
    /// The first error of `to`.
    pub fn try_map<E>(mut self, to: impl Fn(DVec2) -> Result<DVec2, E>) -> Result<Self, E> {
        let map_line = |line: &mut LineString<f64>| try_map_line(line, &to);
        for point in &mut self.points {
            *point = to(*point)?;
        }
        self.lines.iter_mut().try_for_each(map_line)?;
        for polygon in &mut self.polygons {
            polygon.try_exterior_mut(map_line)?;
            polygon.try_interiors_mut(|holes| holes.iter_mut().try_for_each(map_line))?;
        }
        Ok(self)
    }

    /// Whether there are no shapes.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.points.is_empty() && self.lines.is_empty() && self.polygons.is_empty()
    }

    /// Whether a point lies in one of the polygons.
    #[must_use]
    pub fn contains(&self, at: DVec2) -> bool {
        self.polygons.iter().any(|polygon| contains(polygon, at))
    }

    /// All points, and the vertices of lines and polygons.
    pub fn vertices(&self) -> impl Iterator<Item = DVec2> + '_ {
        let on_lines = self.lines.iter().chain(self.rings()).flat_map(|line| line.coords());
        self.points.iter().copied().chain(on_lines.map(|&at| vector(at)))
    }

    /// Segments of the lines and of the borders of the polygons.
    pub fn segments(&self) -> impl Iterator<Item = [DVec2; 2]> + '_ {
        self.lines.iter().chain(self.rings()).flat_map(segments)
    }

    /// The points, and the vertices of lines and borders, each with the vectors to the two vertices next to it; zero where there is none.
    pub(crate) fn corners(&self) -> impl Iterator<Item = (DVec2, [DVec2; 2])> + '_ {
        let points = self.points.iter().map(|&point| (point, [DVec2::ZERO; 2]));
        points.chain(self.lines.iter().chain(self.rings()).flat_map(corners))
    }

    fn rings(&self) -> impl Iterator<Item = &LineString<f64>> {
        self.polygons.iter().flat_map(rings)
    }
}

/// Whether a point lies in the polygon.
pub(crate) fn contains(polygon: &Polygon<f64>, at: DVec2) -> bool {
    let borders = rings(polygon).flat_map(segments);
    borders.filter_map(|border| crossing(border, at.y)).filter(|&x| at.x < x).count() % 2 == 1
}

/// Visits the nodes in a polygon, as `(column, row)`: row by row between the crossings of its borders. The cost is proportional to the
/// number of crossings and of nodes.
pub(crate) fn nodes_inside(
    polygon: &Polygon<f64>,
    tiling: &Tiling,
    mut visit: impl FnMut(usize, usize),
) {
    let heights = rings(polygon).flat_map(|ring| ring.coords()).map(|at| at.y);
    let (north, south) =
        heights.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), y| (a.min(y), b.max(y)));
    let rows = tiling.span(1, north, south);
    let mut crossings = vec![Vec::new(); rows.len()];
    for [a, b] in rings(polygon).flat_map(segments) {
        for row in tiling.span(1, a.y.min(b.y), a.y.max(b.y)) {
            let x = crossing([a, b], row as f64).filter(|x| x.is_finite());
            crossings[(row - rows.start) as usize].extend(x);
        }
    }
    for (row, mut crossings) in rows.zip(crossings) {
        crossings.sort_unstable_by(f64::total_cmp);
        for ends in crossings.chunks_exact(2) {
            for col in tiling.span(0, ends[0], ends[1]) {
                if let Some((col, row)) = tiling.node(col, row) {
                    visit(col, row);
                }
            }
        }
    }
}

/// Where a segment crosses the horizontal line at `y`, if it does. An end on that line counts as lying on the side of smaller `y`, so that a
/// border that only touches the line crosses it twice or not at all.
fn crossing([a, b]: [DVec2; 2], y: f64) -> Option<f64> {
    ((a.y > y) != (b.y > y)).then(|| a.x + (y - a.y) / (b.y - a.y) * (b.x - a.x))
}

/// The exterior and the holes.
fn rings(polygon: &Polygon<f64>) -> impl Iterator<Item = &LineString<f64>> {
    once(polygon.exterior()).chain(polygon.interiors())
}

fn segments(line: &LineString<f64>) -> impl Iterator<Item = [DVec2; 2]> + '_ {
    line.lines().map(|segment| [vector(segment.start), vector(segment.end)])
}

fn try_map_line<E>(
    line: &mut LineString<f64>,
    to: impl Fn(DVec2) -> Result<DVec2, E>,
) -> Result<(), E> {
    line.coords_mut().try_for_each(|at| {
        (at.x, at.y) = to(vector(*at))?.into();
        Ok(())
    })
}

/// The vertices of a line, each with the vectors to its neighbours. A point that is repeated counts once.
fn corners(line: &LineString<f64>) -> Vec<(DVec2, [DVec2; 2])> {
    let mut vertices: Vec<DVec2> = line.coords().map(|&at| vector(at)).collect();
    vertices.dedup();
    let closed = vertices.len() > 1 && vertices.first() == vertices.last();
    if closed {
        vertices.pop();
    }
    let count = vertices.len();
    let neighbours = |i: usize| match closed {
        true => [Some((i + count - 1) % count), Some((i + 1) % count)],
        false => [i.checked_sub(1), Some(i + 1).filter(|&next| next < count)],
    };
    let vector = |from: usize, to: usize| vertices[to] - vertices[from];
    let edges = |i| neighbours(i).map(|to| to.map_or(DVec2::ZERO, |to| vector(i, to)));
    (0..count).map(|i| (vertices[i], edges(i))).collect()
}

fn vector(at: impl Into<(f64, f64)>) -> DVec2 {
    at.into().into()
}
