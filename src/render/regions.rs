//! Regions on a map: their colours, borders and seeds.

use geo_types::MultiPolygon;
use glam::{DVec2, Vec2};

use super::colour::Rgb;
use super::layout::MapLayout;
use super::region_numbers::draw_numbers;

/// Largest size of a region's number, in pixels of a picture of the default size.
const NUMBER: f32 = 30.0;
/// Radius and rim of the mark of a seed.
const SEED: [f32; 2] = [3.5, 1.5];

/// Regions of a grid. Each that has room for it is numbered, counted from 1.
#[derive(Clone, Debug)]
pub struct RegionLayer<'a> {
    /// Region of each node, row-major; `None` for none.
    pub labels: &'a [Option<u32>],
    /// Colour of each region.
    pub colours: Vec<Rgb>,
    /// Polygons whose rings are drawn as borders, level by level: the first thickest.
    pub borders: Vec<&'a [MultiPolygon<f64>]>,
    /// Points to mark, in grid coordinates.
    pub seeds: Vec<DVec2>,
}

impl RegionLayer<'_> {
    pub(super) fn colour(&self, node: usize) -> Option<Rgb> {
        self.colours.get((*self.labels.get(node)?)? as usize).copied()
    }

    pub(super) fn draw_borders(&self, layout: &mut MapLayout) {
        for (level, regions) in self.borders.iter().enumerate().rev() {
            let rings: Vec<_> = regions
                .iter()
                .flatten()
                .flat_map(|polygon| polygon.interiors().iter().chain([polygon.exterior()]))
                .map(|ring| ring.coords().map(|at| DVec2::new(at.x, at.y)).collect())
                .collect();
            let lines = layout.lines(&rings);
            let width = if level + 1 == self.borders.len() { 1.2 } else { 3.0 };
            layout.canvas.lines(&lines, width * layout.unit, Rgb::INK, 0.7);
        }
        for &seed in &self.seeds {
            let at = layout.to_pixels(seed);
            let [radius, rim] = SEED.map(|size| size * layout.unit);
            layout.canvas.disc(at, radius, rim, Rgb::INK);
        }
    }

    /// Writes the numbers, away from the marks of the seeds; `node` gives the node nearest to grid coordinates.
    pub(super) fn draw_numbers(
        &self,
        layout: &mut MapLayout,
        node: impl Fn(DVec2) -> usize + Sync,
    ) {
        let label = |at: DVec2| self.labels.get(node(at)).copied().flatten();
        let ([left, top, width, height], mut pixels) = layout.sample(label);
        let reach = SEED.iter().sum::<f32>() * layout.unit;
        for &seed in &self.seeds {
            let at = layout.to_pixels(seed) - Vec2::new(left as f32, top as f32);
            for y in pixels_around(at.y, reach, height) {
                pixels[y * width..][pixels_around(at.x, reach, width)].fill(None);
            }
        }
        draw_numbers(&mut layout.canvas, &pixels, [left, top, width], NUMBER * layout.unit);
    }
}

/// The pixels of a row or column of `count` that lie within `reach` of a position.
fn pixels_around(at: f32, reach: f32, count: usize) -> std::ops::Range<usize> {
    (at - reach).max(0.0) as usize..count.min((at + reach) as usize + 1)
}
