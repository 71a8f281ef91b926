//! A map: shaded terrain, regions, isolines, routes, start and goal.

use glam::DVec2;
use image::RgbaImage;

use super::colour::Rgb;
use super::isolines::{IsolineLayer, draw_isolines, draw_labels};
use super::layout::{MapLayout, SIDE};
use super::legend::Entry;
use super::png::encode_png;
use super::regions::RegionLayer;
use super::relief::Relief;
use crate::control::Control;
use crate::error::{Error, Result};
use crate::grid::GridFrame;

/// Barriers are drawn in this colour, mixed half and half with the ground.
const BARRIER: Rgb = Rgb(0x20, 0x20, 0x28);

/// One route.
#[derive(Clone, Debug)]
pub struct RouteLayer<'a> {
    /// Points in grid coordinates.
    pub grid: &'a [DVec2],
    /// Its colour.
    pub colour: Rgb,
    /// What the legend says: name, length, a number; empty for no entry.
    pub label: String,
}

/// What a map shows. Make it by [`MapPicture::new`] and fill the layers.
#[derive(Clone, Debug)]
pub struct MapPicture<'a> {
    /// The grid.
    pub frame: &'a GridFrame,
    /// Heights in metres, row-major; `NaN` where void.
    pub heights: &'a [f64],
    /// Nodes that cannot be entered, row-major; empty for none. Voids need not be named.
    pub barriers: &'a [bool],
    /// Regions, in their colours mixed half and half with the ground; `None` for none.
    pub regions: Option<RegionLayer<'a>>,
    /// Isolines, drawn in this order.
    pub isolines: Vec<IsolineLayer<'a>>,
    /// Routes, drawn in this order, each thinner than the one before, so that all of them are seen
    /// where they run together.
    pub routes: Vec<RouteLayer<'a>>,
    /// Starts, in grid coordinates.
    pub starts: Vec<DVec2>,
    /// Goals, in grid coordinates: marked G, or numbered from 1 if there are several.
    pub goals: Vec<DVec2>,
    /// The line above the map; empty for none.
    pub title: String,
    /// Pixels of the map's longer side, 100 to 8192. Default: 1600.
    pub max_side_px: u32,
    /// Asked whether to cancel while the ground is painted.
    pub control: Control,
}

impl<'a> MapPicture<'a> {
    /// A map of the terrain alone.
    #[must_use]
    pub fn new(frame: &'a GridFrame, heights: &'a [f64]) -> Self {
        Self {
            frame,
            heights,
            barriers: &[],
            regions: None,
            isolines: Vec::new(),
            routes: Vec::new(),
            starts: Vec::new(),
            goals: Vec::new(),
            title: String::new(),
            max_side_px: SIDE,
            control: Control::default(),
        }
    }

    /// Draws the map.
    ///
    /// # Errors
    /// [`Error::Argument`] if heights or barriers are not one per node, or the size is out of bounds; cancelled.
    pub fn render(&self) -> Result<RgbaImage> {
        let nodes = self.frame.nodes();
        if self.heights.len() != nodes || ![0, nodes].contains(&self.barriers.len()) {
            return Err(Error::argument(
                "the number of heights and that of barriers",
                format!("{} and {}", self.heights.len(), self.barriers.len()),
                format!("{nodes}, that of the nodes; there may be no barriers"),
            ));
        }
        let mut layout = MapLayout::new(self.frame, &self.title, self.max_side_px, self.legend())?;
        self.draw_ground(&mut layout)?;
        if let Some(regions) = &self.regions {
            regions.draw_borders(&mut layout);
            regions.draw_numbers(&mut layout, |grid| self.node(grid));
        }
        let mut labels = Vec::new();
        for layer in &self.isolines {
            labels.extend(draw_isolines(&mut layout, layer));
        }
        let on_top = self.routes.iter().flat_map(|r| r.grid).chain(&self.starts).chain(&self.goals);
        let taken: Vec<_> = on_top.map(|&p| layout.to_pixels(p)).collect();
        draw_labels(&mut layout, labels, &taken);
        self.draw_routes(&mut layout);
        self.starts.iter().for_each(|&at| layout.pin(at, "S", Rgb::GREEN));
        for (i, &at) in self.goals.iter().enumerate() {
            layout.pin(at, &self.goal_mark(i), Rgb::PURPLE);
        }
        Ok(layout.finish())
    }

    /// [`render`](Self::render) as a PNG file.
    ///
    /// # Errors
    /// As [`render`](Self::render).
    pub fn png(&self) -> Result<Vec<u8>> {
        encode_png(&self.render()?)
    }

    /// The letter or number on the pin of a goal.
    fn goal_mark(&self, goal: usize) -> String {
        if self.goals.len() == 1 { "G".into() } else { (goal + 1).to_string() }
    }

    fn legend(&self) -> Vec<Entry> {
        let mut items = Vec::new();
        let goal = if self.goals.len() > 1 { "first goal" } else { "goal" };
        for (places, mark, colour, label) in [
            (&self.starts, "S".into(), Rgb::GREEN, "start"),
            (&self.goals, self.goal_mark(0), Rgb::PURPLE, goal),
        ] {
            if !places.is_empty() {
                items.push(Entry::Pin { colour, mark, label: label.into() });
            }
        }
        let line = |colour, width, label: &String| {
            (!label.is_empty()).then(|| Entry::Line { colour, width, label: label.clone() })
        };
        let routes = self.routes.iter().enumerate();
        items.extend(routes.filter_map(|(i, r)| line(r.colour, self.route_width(i), &r.label)));
        items.extend(self.isolines.iter().filter_map(|l| line(l.colour, 2.0, &l.label)));
        if self.barriers.iter().zip(self.heights).any(|(&barrier, h)| barrier && h.is_finite()) {
            let colour = Rgb(0xd8, 0xd2, 0xc0).mix(BARRIER, 0.5);
            items.push(Entry::Patch { colour: Some(colour), label: "barrier".into() });
        }
        if self.heights.iter().any(|h| !h.is_finite()) {
            items.push(Entry::Patch { colour: None, label: "no data".into() });
        }
        items
    }

    /// The node nearest to grid coordinates.
    fn node(&self, grid: DVec2) -> usize {
        let node = self.frame.clamp(grid).round();
        self.frame.index(node.x as usize, node.y as usize)
    }

    fn draw_ground(&self, layout: &mut MapLayout) -> Result<()> {
        let relief = Relief::new(self.frame, self.heights, self.max_side_px as usize);
        layout.ground(&self.control, |grid| {
            let colour = relief.at(grid)?;
            let node = self.node(grid);
            let barrier = self.barriers.get(node);
            let region = self.regions.as_ref().and_then(|regions| regions.colour(node));
            let colour = region.map_or(colour, |region| colour.mix(region, 0.5));
            Some(if barrier == Some(&true) { colour.mix(BARRIER, 0.5) } else { colour })
        })
    }

    /// Width of a route on the map and in the legend.
    fn route_width(&self, route: usize) -> f32 {
        4.5 + 3.0 * (self.routes.len() - 1 - route).min(3) as f32
    }

    fn draw_routes(&self, layout: &mut MapLayout) {
        let lines: Vec<_> =
            self.routes.iter().map(|route| layout.lines(&[route.grid.to_vec()])).collect();
        let widths: Vec<_> = (0..lines.len()).map(|i| self.route_width(i) * layout.unit).collect();
        let casing = 3.5 * layout.unit;
        for (line, width) in lines.iter().zip(&widths) {
            layout.canvas.lines(line, width + casing, Rgb::WHITE, 0.9);
        }
        for ((line, width), route) in lines.iter().zip(&widths).zip(&self.routes) {
            layout.canvas.lines(line, *width, route.colour, 1.0);
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec2;

    use super::*;
    use crate::grid::Ground;

    fn frame(cols: usize, rows: usize) -> GridFrame {
        GridFrame::new(cols, rows, DVec2::ZERO, DVec2::splat(30.0), Ground::METRES).unwrap()
    }

    #[test]
    fn odd_grids_make_pictures() {
        for (cols, rows) in [(1, 1), (2, 300), (300, 2), (3, 3)] {
            let frame = frame(cols, rows);
            for height in [0.0, 1e30, f64::NAN] {
                let heights = vec![height; cols * rows];
                let mut map = MapPicture::new(&frame, &heights);
                map.max_side_px = 300;
                map.title = "a long title ".repeat(50);
                map.starts = vec![DVec2::ZERO];
                let picture = map.render().unwrap();
                assert!(picture.width() < 700 && picture.height() < 700);
                assert!(map.png().unwrap().starts_with(b"\x89PNG"));
            }
        }
    }

    #[test]
    fn layers_are_where_they_belong() {
        let frame = frame(100, 50);
        let heights = vec![0.0; 5000];
        let mut barriers = vec![false; 5000];
        barriers[10 * 100 + 80] = true;
        let path = [DVec2::new(10.0, 25.0), DVec2::new(90.0, 25.0)];
        let mut map = MapPicture::new(&frame, &heights);
        map.max_side_px = 1600;
        map.barriers = &barriers;
        map.routes = vec![RouteLayer { grid: &path, colour: Rgb::BLUE, label: "r".into() }];
        map.starts = vec![path[0]];
        map.goals = vec![path[1]];
        let picture = map.render().unwrap();
        let layout = MapLayout::new(&frame, "", 1600, []).unwrap();
        let pixel = |grid: DVec2, off: f32| {
            let at = layout.to_pixels(grid);
            let [r, g, b, _] = picture.get_pixel(at.x as u32, (at.y + off) as u32).0;
            Rgb(r, g, b)
        };
        assert_eq!(pixel(DVec2::new(50.0, 25.0), 0.0), Rgb::BLUE);
        assert_eq!(pixel(path[0], 11.5), Rgb::GREEN);
        assert_eq!(pixel(path[1], 11.5), Rgb::PURPLE);
        let ground = pixel(DVec2::new(50.0, 10.0), 0.0);
        assert_eq!(pixel(DVec2::new(80.0, 10.0), 0.0), ground.mix(BARRIER, 0.5));
        // Twice as wide as tall, as on the ground.
        assert_eq!(
            layout.to_pixels(DVec2::new(99.5, 49.5)) - layout.to_pixels(DVec2::splat(-0.5)),
            Vec2::new(1600.0, 800.0)
        );
    }

    #[test]
    fn who_cancels_gets_no_map() {
        let frame = frame(3, 3);
        let map = MapPicture::new(&frame, &[0.0; 9]);
        map.control.cancel.cancel();
        assert!(matches!(map.png(), Err(Error::Cancelled)));
    }

    #[test]
    fn wrong_sizes_are_refused() {
        let frame = frame(3, 3);
        assert!(MapPicture::new(&frame, &[0.0; 8]).render().is_err());
        let mut map = MapPicture::new(&frame, &[0.0; 9]);
        map.max_side_px = 1 << 20;
        assert!(map.render().is_err());
    }
}
