//! Regions on a map: their colours, borders and seeds.

use geo_types::MultiPolygon;
use glam::{DVec2, Vec2};

use super::canvas::{Canvas, Rgb};
use super::layout::MapLayout;
use super::text;

/// Light colours that differ in hue and in brightness; ColorBrewer's Set3 without its greys.
const PALETTE: [Rgb; 10] = [
    Rgb(0x8d, 0xd3, 0xc7),
    Rgb(0xfb, 0x80, 0x72),
    Rgb(0xff, 0xff, 0xb3),
    Rgb(0x80, 0xb1, 0xd3),
    Rgb(0xfd, 0xb4, 0x62),
    Rgb(0xbe, 0xba, 0xda),
    Rgb(0xb3, 0xde, 0x69),
    Rgb(0xbc, 0x80, 0xbd),
    Rgb(0xcc, 0xeb, 0xc5),
    Rgb(0xfc, 0xcd, 0xe5),
];

/// Largest size of a region's number, in pixels of a picture of the default size.
const NUMBER: f32 = 30.0;
/// No number is smaller than this in any picture, pixels.
const LEGIBLE: f32 = 10.0;
/// Radius and rim of the mark of a seed.
const SEED: [f32; 2] = [3.5, 1.5];

/// Regions of a grid. Each that has room for it bears its number, counted from 1.
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
            let at = layout.place(seed);
            let [radius, rim] = SEED.map(|size| size * layout.unit);
            layout.canvas.disc(at, radius, rim, Rgb::INK);
        }
    }

    /// Writes the numbers beside the seeds; `node` is the one at grid coordinates.
    pub(super) fn draw_numbers(
        &self,
        layout: &mut MapLayout,
        node: impl Fn(DVec2) -> usize + Sync,
    ) {
        let label = |at: DVec2| self.labels.get(node(at)).copied().flatten();
        let ([left, top, width, height], mut pixels) = layout.sample(label);
        let reach = SEED.iter().sum::<f32>() * layout.unit;
        for &seed in &self.seeds {
            let at = layout.place(seed) - Vec2::new(left as f32, top as f32);
            let span = |at: f32, end: usize| {
                (at - reach).max(0.0) as usize..end.min((at + reach) as usize + 1)
            };
            for y in span(at.y, height) {
                let columns = span(at.x, width);
                pixels[y * width..][columns].fill(None);
            }
        }
        draw_numbers(&mut layout.canvas, &pixels, [left, top, width], NUMBER * layout.unit);
    }
}

/// Writes the number of each region, counted from 1, into the middle of its roomiest place, where it has one. `pixels` are the regions of a
/// part of the canvas of so many columns, `left` and `top` its corner; sizes are between `largest` and half of it.
pub(super) fn draw_numbers(
    canvas: &mut Canvas,
    pixels: &[Option<u32>],
    [left, top, width]: [usize; 3],
    largest: f32,
) {
    for (region, room) in rooms(pixels, width).into_iter().enumerate() {
        let number = (region + 1).to_string();
        // Half of the text per pixel of its size; half of DejaVu's capital height, 0.729 em, centres it.
        let half = Vec2::new(0.5 * text::width(&number, 1.0), 0.365);
        let size = largest.min(0.9 * room.half / half.max_element());
        if size >= LEGIBLE.max(0.5 * largest) {
            let middle = room.middle + Vec2::new(left as f32, top as f32);
            let baseline = middle + size * Vec2::new(-half.x, half.y);
            canvas.text(&number, size, baseline, Rgb::INK, largest / 12.0);
        }
    }
}

/// A square of pixels of one region, in pixels.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Room {
    middle: Vec2,
    /// Half of its side; 0 if the region has no pixel.
    half: f32,
}

/// The largest square within each region, on rows of `width` pixels; of equal ones that nearest to the centroid. So it lies in the region also
/// where the centroid does not.
fn rooms(pixels: &[Option<u32>], width: usize) -> Vec<Room> {
    let reach = chessboard_distances(pixels, width);
    let count = pixels.iter().flatten().max().map_or(0, |&last| last as usize + 1);
    let place = |i: usize| DVec2::new((i % width) as f64, (i / width) as f64) + 0.5;
    let labelled =
        || pixels.iter().enumerate().filter_map(|(i, region)| Some((i, (*region)? as usize)));
    let mut sums = vec![(DVec2::ZERO, 0.0); count];
    for (i, region) in labelled() {
        sums[region].0 += place(i);
        sums[region].1 += 1.0;
    }
    let mut rooms = vec![Room::default(); count];
    for (i, region) in labelled() {
        let off = |at: DVec2| at.distance_squared(sums[region].0 / sums[region].1);
        let (room, half) = (&mut rooms[region], reach[i] as f32 - 0.5);
        let is_nearer = || off(place(i)) < off(room.middle.as_dvec2());
        if half > room.half || (half == room.half && is_nearer()) {
            *room = Room { middle: place(i).as_vec2(), half };
        }
    }
    rooms
}

/// Steps of a chess king from each pixel to the nearest that is of another region or outside (Rosenfeld and Pfaltz 1966: two passes are enough).
fn chessboard_distances(pixels: &[Option<u32>], width: usize) -> Vec<u32> {
    let mut steps = vec![u32::MAX; pixels.len()];
    let before: [(isize, isize); 4] = [(-1, -1), (0, -1), (1, -1), (-1, 0)];
    for forward in [true, false] {
        for k in 0..pixels.len() {
            let (i, sign) = if forward { (k, 1) } else { (pixels.len() - 1 - k, -1) };
            for (dx, dy) in before {
                let col = (i % width).checked_add_signed(sign * dx).filter(|&col| col < width);
                let row = (i / width).checked_add_signed(sign * dy);
                let other = col.zip(row).map(|(col, row)| row * width + col);
                let beyond = match other.filter(|&other| pixels.get(other) == Some(&pixels[i])) {
                    Some(other) => steps[other].saturating_add(1),
                    None => 1,
                };
                steps[i] = steps[i].min(beyond);
            }
        }
    }
    steps
}

/// Colours for so many regions of a grid of `cols` columns such that neighbours differ wherever ten colours are enough for the
/// order in which they are given out.
#[must_use]
pub fn contrasting_colours(labels: &[Option<u32>], cols: usize, regions: usize) -> Vec<Rgb> {
    let mut pairs = Vec::new();
    for (node, label) in labels.iter().enumerate() {
        let east = if (node + 1) % cols.max(1) == 0 { None } else { labels.get(node + 1) };
        for other in [east, labels.get(node + cols)].into_iter().flatten() {
            if let (Some(a), Some(b)) = (label, other)
                && a != b
            {
                pairs.extend([(*a, *b), (*b, *a)]);
            }
        }
    }
    pairs.sort_unstable();
    pairs.dedup();
    let mut chosen: Vec<usize> = Vec::with_capacity(regions);
    for region in 0..regions {
        let first = pairs.partition_point(|pair| (pair.0 as usize) < region);
        let beside = pairs[first..].iter().take_while(|pair| pair.0 as usize == region);
        let taken: Vec<usize> =
            beside.filter_map(|pair| chosen.get(pair.1 as usize).copied()).collect();
        // Begins at another colour each time, or most regions would have the first few.
        let mut colours = (0..PALETTE.len()).map(|i| (region + i) % PALETTE.len());
        let free = colours.find(|colour| !taken.contains(colour));
        chosen.push(free.unwrap_or(region % PALETTE.len()));
    }
    chosen.into_iter().map(|colour| PALETTE[colour]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_lie_within_their_regions() {
        let picture = "0000000000\n\
                       0000000000\n\
                       0002222222\n\
                       0002221112\n\
                       0002221112\n\
                       0002221112\n\
                       0002222222\n\
                       00000000.3\n\
                       0000000000";
        let pixels: Vec<_> =
            picture.lines().flat_map(|l| l.chars().map(|c| c.to_digit(10))).collect();
        let at = |x: f32, y: f32, half| Room { middle: Vec2::new(x, y), half };
        // Region 0 is a C around 2, whose centroid is in 2; region 2 a ring around 1, widest in the west.
        let rooms = rooms(&pixels, 10);
        assert_eq!(
            rooms,
            [at(1.5, 4.5, 1.5), at(7.5, 4.5, 1.5), at(4.5, 4.5, 1.5), at(9.5, 7.5, 0.5)]
        );
        assert!(super::rooms(&[None; 4], 2).is_empty());
    }

    #[test]
    fn neighbours_differ_in_colour() {
        // Bricks: each touches six others.
        let (cols, rows) = (60, 40);
        let label = |i: usize| {
            let (col, row) = (i % cols, i / cols / 4);
            Some((row * 10 + ((col + 3 * (row % 2)) / 6) % 10) as u32)
        };
        let labels: Vec<_> = (0..cols * rows).map(label).collect();
        let colours = contrasting_colours(&labels, cols, 100);
        let colour = |i: usize| colours[labels[i].unwrap() as usize];
        for i in (0..labels.len() - cols).filter(|i| i % cols + 1 < cols) {
            for other in [i + 1, i + cols] {
                assert!(labels[i] == labels[other] || colour(i) != colour(other));
            }
        }
    }
}
