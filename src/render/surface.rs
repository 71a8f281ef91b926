//! Surfaces in space: shaded, coloured by node, seen from afar.

use glam::{DVec2, DVec3, Vec2};
use image::RgbaImage;
use rayon::prelude::*;

use super::canvas::Canvas;
use super::colour::Rgb;
use super::layout::{SIDE, SIDES};
use super::png::encode_png;
use super::region_numbers::draw_numbers;
use super::text;
use crate::error::{Error, Result};
use crate::surface::Surface;

/// Share of the light that is everywhere.
const AMBIENT: f64 = 0.4;
/// The back of the surface, which its normal points away from, is this much darker.
const BACK: f64 = 0.75;
/// Samples along each side of a pixel.
const SAMPLES: usize = 2;
/// Share of the picture around the surface.
const MARGIN: f64 = 0.04;
/// A line is drawn this share of the surface's size before it, so that the surface's own pieces do not hide it.
const LIFT: f64 = 0.005;

/// What a picture of a surface in space shows. Parallel projection, z up.
#[derive(Clone)]
pub struct SurfacePicture<'a> {
    /// The surface. Nodes that are void leave holes.
    pub surface: &'a dyn Surface,
    /// A colour per node, row-major.
    pub colours: &'a [Rgb],
    /// Whether colours go over into each other between nodes, as those of a field, or each node has its own place, as
    /// labels do. Default: true.
    pub blend: bool,
    /// Region of each node, row-major, whose numbers, counted from 1, are written where they are seen and have room; empty for none.
    /// Default: none.
    pub regions: &'a [Option<u32>],
    /// Lines in grid coordinates on the surface, such as routes and isolines. Default: none.
    pub lines: Vec<(Vec<DVec2>, Rgb)>,
    /// Points in grid coordinates, such as seeds. Default: none.
    pub points: Vec<(DVec2, Rgb)>,
    /// Direction from the surface to who looks at it. Default: (1, −2, 1).
    pub view: DVec3,
    /// The line above the surface; empty for none.
    pub title: String,
    /// Pixels of the picture's longer side. Default: 1600.
    pub max_side_px: u32,
}

impl<'a> SurfacePicture<'a> {
    /// A picture of a surface with a colour per node.
    #[must_use]
    pub fn new(surface: &'a dyn Surface, colours: &'a [Rgb]) -> Self {
        Self {
            surface,
            colours,
            blend: true,
            regions: &[],
            lines: Vec::new(),
            points: Vec::new(),
            view: DVec3::new(1.0, -2.0, 1.0),
            title: String::new(),
            max_side_px: SIDE,
        }
    }

    /// Draws the picture.
    ///
    /// # Errors
    /// [`Error::Argument`] if there is not one colour, or region, per node, the size is out of bounds, the view has no direction, or there is
    /// nothing to see.
    pub fn render(&self) -> Result<RgbaImage> {
        let (cols, rows) = (self.surface.cols(), self.surface.rows());
        if self.colours.len() != cols * rows {
            return Err(Error::argument(
                "the number of colours",
                self.colours.len(),
                format!("{}, that of the nodes", cols * rows),
            ));
        }
        if !SIDES.contains(&self.max_side_px) {
            return Err(Error::argument(
                "the longer side of a picture",
                format!("{} pixels", self.max_side_px),
                format!("between {} and {}", SIDES.start(), SIDES.end()),
            ));
        }
        if ![0, cols * rows].contains(&self.regions.len()) {
            let found = self.regions.len();
            return Err(Error::argument(
                "the number of regions",
                found,
                format!("{}, that of the nodes", cols * rows),
            ));
        }
        let camera = Camera::new(self.view)?;
        let nodes: Vec<Option<Vertex>> =
            (0..rows).into_par_iter().flat_map_iter(|row| self.vertices(row, &camera)).collect();
        let mut film = Film::new(&nodes, self.max_side_px)?;

        let [across, down] = self.surface.periodic();
        let last = |count: usize, periodic: bool| if periodic { count } else { count - 1 };
        for row in 0..last(rows, down) {
            for col in 0..last(cols, across) {
                let node = |i: usize, j: usize| nodes[(row + j) % rows * cols + (col + i) % cols];
                let corners = [node(0, 0), node(1, 0), node(1, 1), node(0, 1)];
                for triangle in [[0, 1, 2], [0, 2, 3]].map(|three| three.map(|i: usize| corners[i]))
                {
                    if let [Some(a), Some(b), Some(c)] = triangle {
                        film.triangle([a, b, c], self.blend);
                    }
                }
            }
        }
        let place = |at: DVec2| camera.place(self.surface.space_jet(at).point);
        for (line, colour) in &self.lines {
            for ends in line.windows(2) {
                film.line(place(ends[0]), place(ends[1]), *colour);
            }
        }
        for (at, colour) in &self.points {
            film.disc(place(*at), 4.0, *colour);
        }
        film.develop(&self.title)
    }

    /// [`render`](Self::render) as a PNG file.
    ///
    /// # Errors
    /// As [`render`](Self::render).
    pub fn png(&self) -> Result<Vec<u8>> {
        encode_png(&self.render()?)
    }

    /// The nodes of a row as they are seen; `None` where void.
    fn vertices(&self, row: usize, camera: &Camera) -> Vec<Option<Vertex>> {
        let jets = self.surface.row_space_jets(row).into_iter().enumerate();
        jets.map(|(col, jet)| {
            let known = !self.surface.is_void(col, row) && jet.point.is_finite();
            known.then(|| Vertex {
                at: camera.place(jet.point),
                light: camera.light(jet.normal()),
                colour: self.colours[row * self.surface.cols() + col],
                region: self.regions.get(row * self.surface.cols() + col).copied().flatten(),
            })
        })
        .collect()
    }
}

impl std::fmt::Debug for SurfacePicture<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("SurfacePicture").field("title", &self.title).finish_non_exhaustive()
    }
}

/// Pictures side by side, from left to right, on white.
///
/// # Errors
/// [`Error::Argument`] if there is none or they are too large together.
pub fn beside(pictures: &[RgbaImage]) -> Result<RgbaImage> {
    let width = pictures.iter().map(RgbaImage::width).sum();
    let height = pictures.iter().map(RgbaImage::height).max().unwrap_or(0);
    let mut all = Canvas::new(width, height)?.into_image();
    let mut left = 0;
    for picture in pictures {
        image::imageops::replace(&mut all, picture, left, 0);
        left += i64::from(picture.width());
    }
    Ok(all)
}

/// Who looks, and where the light is.
struct Camera {
    right: DVec3,
    up: DVec3,
    /// To the viewer.
    view: DVec3,
}

impl Camera {
    fn new(view: DVec3) -> Result<Self> {
        let view =
            view.try_normalize().ok_or_else(|| Error::argument("the view", view, "a direction"))?;
        // From straight above, y is up.
        let right = DVec3::Z.cross(view).try_normalize().unwrap_or(DVec3::X);
        Ok(Self { right, up: view.cross(right), view })
    }

    /// Right, down, towards the viewer.
    fn place(&self, p: DVec3) -> DVec3 {
        DVec3::new(p.dot(self.right), -p.dot(self.up), p.dot(self.view))
    }

    /// Brightness of a piece of surface with this normal: the lamp is up and to the left of the viewer.
    fn light(&self, normal: DVec3) -> f64 {
        let lamp = (self.view - 0.6 * self.right + 0.8 * self.up).normalize();
        let back = normal.dot(self.view) < 0.0;
        let normal = if back { -normal } else { normal };
        // Half of what faces away from the lamp would be black; so the form shows there too, and colours can be read.
        let light = AMBIENT + (1.0 - AMBIENT) * (0.5 + 0.5 * normal.dot(lamp));
        if back { BACK * light } else { light }
    }
}

#[derive(Clone, Copy)]
struct Vertex {
    at: DVec3,
    light: f64,
    colour: Rgb,
    region: Option<u32>,
}

/// Samples of the picture, each with the depth of what was nearest so far.
struct Film {
    width: usize,
    height: usize,
    colours: Vec<Rgb>,
    depths: Vec<f64>,
    /// What region is seen; none on lines and points.
    regions: Vec<Option<u32>>,
    /// Samples per metre, and the place of sample 0, 0.
    scale: f64,
    origin: DVec2,
    size: f64,
}

impl Film {
    fn new(nodes: &[Option<Vertex>], side: u32) -> Result<Self> {
        let places = || nodes.iter().flatten().map(|vertex| vertex.at);
        let least = places().fold(DVec3::INFINITY, DVec3::min);
        let most = places().fold(DVec3::NEG_INFINITY, DVec3::max);
        let size = least.distance(most);
        let extent = (most - least).truncate();
        if !(size.is_finite() && extent.max_element() > 0.0) {
            return Err(Error::argument(
                "the part of the surface that can be seen",
                "empty",
                "not empty",
            ));
        }
        let margin = MARGIN * extent.max_element();
        let extent = extent + 2.0 * margin;
        let scale = f64::from(side) * SAMPLES as f64 / extent.max_element();
        let [width, height] =
            <[f64; 2]>::from(extent * scale).map(|samples| samples.ceil() as usize);
        let (width, height) = (width.next_multiple_of(SAMPLES), height.next_multiple_of(SAMPLES));
        Ok(Self {
            width,
            height,
            colours: vec![Rgb::WHITE; width * height],
            depths: vec![f64::NEG_INFINITY; width * height],
            regions: vec![None; width * height],
            scale,
            origin: least.truncate() - margin,
            size,
        })
    }

    /// In samples.
    fn on_film(&self, at: DVec3) -> DVec2 {
        (at.truncate() - self.origin) * self.scale
    }

    /// The sample at a place, if what is `depth` near there is nearest so far.
    fn nearest(&mut self, x: usize, y: usize, depth: f64) -> Option<usize> {
        let i = y * self.width + x;
        if x >= self.width || y >= self.height || depth <= self.depths[i] {
            return None;
        }
        self.depths[i] = depth;
        Some(i)
    }

    fn triangle(&mut self, corners: [Vertex; 3], blend: bool) {
        let [a, b, c] = corners.map(|corner| self.on_film(corner.at));
        let area = (b - a).perp_dot(c - a);
        if area == 0.0 {
            return;
        }
        let (least, most) = (a.min(b).min(c).ceil(), a.max(b).max(c));
        for y in least.y as usize..=most.y as usize {
            for x in least.x as usize..=most.x as usize {
                let p = DVec2::new(x as f64, y as f64);
                let shares =
                    [(b - p).perp_dot(c - p), (c - p).perp_dot(a - p), (a - p).perp_dot(b - p)];
                let shares = shares.map(|share| share / area);
                if shares.iter().any(|&share| share < 0.0) {
                    continue;
                }
                let mean = |of: &dyn Fn(&Vertex) -> f64| -> f64 {
                    shares.iter().zip(&corners).map(|(share, corner)| share * of(corner)).sum()
                };
                let depth = mean(&|corner| corner.at.z);
                let Some(sample) = self.nearest(x, y, depth) else { continue };
                let nearest =
                    (1..3).fold(0, |best, i| if shares[i] > shares[best] { i } else { best });
                let colour = if blend {
                    let channel =
                        |of: fn(Rgb) -> u8| mean(&|corner| of(corner.colour).into()).round() as u8;
                    Rgb(channel(|c| c.0), channel(|c| c.1), channel(|c| c.2))
                } else {
                    corners[nearest].colour
                };
                self.colours[sample] = Rgb(0, 0, 0).mix(colour, mean(&|corner| corner.light));
                self.regions[sample] = corners[nearest].region;
            }
        }
    }

    fn line(&mut self, from: DVec3, to: DVec3, colour: Rgb) {
        let steps = self.on_film(from).distance(self.on_film(to)).ceil().clamp(1.0, 1e5);
        for i in 0..=steps as usize {
            self.disc(from.lerp(to, i as f64 / steps), 1.2, colour);
        }
    }

    /// A disc of so many pixels in radius that faces the viewer, a little before the surface.
    fn disc(&mut self, at: DVec3, radius: f64, colour: Rgb) {
        let radius = radius * SAMPLES as f64;
        let (centre, depth) = (self.on_film(at), at.z + LIFT * self.size);
        if !centre.is_finite() {
            return;
        }
        let (least, most) = ((centre - radius).max(DVec2::ZERO), centre + radius);
        for y in least.y as usize..=most.y.max(0.0) as usize {
            for x in least.x as usize..=most.x.max(0.0) as usize {
                if centre.distance(DVec2::new(x as f64, y as f64)) <= radius
                    && let Some(sample) = self.nearest(x, y, depth)
                {
                    self.colours[sample] = colour;
                    self.regions[sample] = None;
                }
            }
        }
    }

    /// The finished picture: means of the samples, and the title.
    fn develop(&self, title: &str) -> Result<RgbaImage> {
        let (width, height) = (self.width / SAMPLES, self.height / SAMPLES);
        let text_size = 0.03 * width.max(height) as f32;
        let head = if title.is_empty() { 0 } else { (2.0 * text_size) as usize };
        let mut canvas = Canvas::new(width as u32, (height + head) as u32)?;
        canvas.paint([0, head, width, height], |x, y| {
            let samples = (0..SAMPLES * SAMPLES).map(|k| {
                let (i, j) = (x * SAMPLES + k % SAMPLES, y * SAMPLES + k / SAMPLES);
                self.colours[j * self.width + i]
            });
            let sums = samples.fold([0; 3], |[r, g, b], c| {
                [r + u32::from(c.0), g + u32::from(c.1), b + u32::from(c.2)]
            });
            let [r, g, b] = sums.map(|sum| (sum / (SAMPLES * SAMPLES) as u32) as u8);
            Rgb(r, g, b)
        });
        let pixels: Vec<_> = (0..width * height)
            .map(|i| self.regions[i / width * SAMPLES * self.width + i % width * SAMPLES])
            .collect();
        draw_numbers(&mut canvas, &pixels, [0, head, width], text_size);
        let title = text::fitted(title, text_size, 0.94 * width as f32);
        canvas.text(
            &title,
            text_size,
            Vec2::new(0.03 * width as f32, 1.4 * text_size),
            Rgb::INK,
            0.0,
        );
        Ok(canvas.into_image())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::surface::{NurbsCurve, NurbsSurface};

    #[test]
    fn the_near_side_is_seen() {
        let ring = |z: f64| NurbsCurve::ellipse(DVec3::Z * z, DVec3::X, DVec3::Y).unwrap();
        let tube = NurbsSurface::ruled(&ring(1.0), &ring(-1.0)).unwrap().on_grid(40, 20).unwrap();
        // Blue where x is positive, orange elsewhere; looked at along x.
        let colours: Vec<Rgb> = (0..800)
            .map(|i| if (i % 40 + 10) % 40 < 20 { Rgb::BLUE } else { Rgb::ORANGE })
            .collect();
        for (view, is_blue) in [(DVec3::X, true), (-DVec3::X, false)] {
            let mut picture = SurfacePicture::new(&tube, &colours);
            (picture.view, picture.max_side_px, picture.blend) = (view, 200, false);
            picture.points.push((DVec2::new(if is_blue { 20.0 } else { 0.0 }, 10.0), Rgb::GREEN));
            let pixels = picture.render().unwrap();
            let [red, _, blue, _] = pixels.get_pixel(100, 100).0;
            assert_eq!(blue > red, is_blue);
            assert_eq!(pixels.get_pixel(2, 2).0[0], 255);
            assert!(pixels.pixels().all(|p| p[1] <= p[0].max(p[2])), "a hidden point");
        }
        let one = SurfacePicture::new(&tube, &colours).render().unwrap();
        assert_eq!(one.width().max(one.height()), 1600);
        assert_eq!(beside(&[one.clone(), one.clone()]).unwrap().width(), 2 * one.width());
        assert!(SurfacePicture::new(&tube, &colours[1..]).render().is_err());
        assert!(
            SurfacePicture { view: DVec3::ZERO, ..SurfacePicture::new(&tube, &colours) }
                .png()
                .is_err()
        );
        assert!(beside(&[]).is_err());
    }
}
