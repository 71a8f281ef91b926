//! Surfaces in space: shaded, coloured by node, seen from afar.

use glam::{DVec2, DVec3, Vec2};
use image::RgbaImage;
use rayon::prelude::*;

use super::camera::Camera;
use super::canvas::Canvas;
use super::colour::Rgb;
use super::depth_buffer::{DepthBuffer, Vertex};
use super::layout::{SIDE, SIDES};
use super::png::encode_png;
use super::region_numbers::draw_numbers;
use super::text;
use crate::error::{Error, Result};
use crate::surface::Surface;

/// What a picture of a surface in space shows. Parallel projection, z up.
#[derive(Clone)]
pub struct SurfacePicture<'a> {
    /// The surface. Nodes that are void leave holes.
    pub surface: &'a dyn Surface,
    /// A colour per node, row-major.
    pub colours: &'a [Rgb],
    /// Whether colours are interpolated between nodes, as those of a field are, or each node's colour fills the part nearest to it, as
    /// for labels. Default: true.
    pub blend: bool,
    /// Region of each node, row-major, whose numbers, counted from 1, are written where they are seen and have room; empty for none.
    /// Default: none.
    pub regions: &'a [Option<u32>],
    /// Lines in grid coordinates on the surface, such as routes and isolines. Default: none.
    pub lines: Vec<(Vec<DVec2>, Rgb)>,
    /// Points in grid coordinates, such as seeds. Default: none.
    pub points: Vec<(DVec2, Rgb)>,
    /// Direction from the surface to the viewer. Default: (1, −2, 1).
    pub view: DVec3,
    /// The line above the surface; empty for none.
    pub title: String,
    /// Pixels of the picture's longer side, 100 to 8192. Default: 1600.
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
        let mut buffer = DepthBuffer::new(&nodes, self.max_side_px)?;
        self.draw_cells(&mut buffer, &nodes);
        for (line, colour) in &self.lines {
            for ends in line.windows(2) {
                buffer.line(
                    self.project(ends[0], &camera),
                    self.project(ends[1], &camera),
                    *colour,
                );
            }
        }
        for (at, colour) in &self.points {
            buffer.disc(self.project(*at, &camera), 4.0, *colour);
        }
        self.compose(&buffer)
    }

    /// Where the camera sees the surface at grid coordinates.
    fn project(&self, at: DVec2, camera: &Camera) -> DVec3 {
        camera.project(self.surface.space_jet(at).point)
    }

    /// [`render`](Self::render) as a PNG file.
    ///
    /// # Errors
    /// As [`render`](Self::render).
    pub fn png(&self) -> Result<Vec<u8>> {
        encode_png(&self.render()?)
    }

    /// Two triangles for each cell whose corners are known.
    fn draw_cells(&self, buffer: &mut DepthBuffer, nodes: &[Option<Vertex>]) {
        let (cols, rows) = (self.surface.cols(), self.surface.rows());
        let [across, down] = self.surface.periodic();
        for row in 0..cells(rows, down) {
            for col in 0..cells(cols, across) {
                let [a, b, c, d] = [(0, 0), (1, 0), (1, 1), (0, 1)]
                    .map(|(i, j)| nodes[(row + j) % rows * cols + (col + i) % cols]);
                for triangle in [[a, b, c], [a, c, d]] {
                    if let [Some(a), Some(b), Some(c)] = triangle {
                        buffer.triangle([a, b, c], self.blend);
                    }
                }
            }
        }
    }

    /// What is seen, the numbers of the regions on it, and the title above.
    fn compose(&self, buffer: &DepthBuffer) -> Result<RgbaImage> {
        let [width, height] = buffer.size();
        let text_size = 0.03 * width.max(height) as f32;
        let head = if self.title.is_empty() { 0 } else { (2.0 * text_size) as usize };
        let mut canvas = Canvas::new(width as u32, (height + head) as u32)?;
        canvas.paint([0, head, width, height], |x, y| buffer.colour(x, y));
        draw_numbers(&mut canvas, &buffer.regions(), [0, head, width], text_size);
        let title = text::fitted(&self.title, text_size, 0.94 * width as f32);
        let baseline = Vec2::new(0.03 * width as f32, 1.4 * text_size);
        canvas.text(&title, text_size, baseline, Rgb::INK, 0.0);
        Ok(canvas.into_image())
    }

    /// The nodes of a row as they are seen; `None` where void.
    fn vertices(&self, row: usize, camera: &Camera) -> Vec<Option<Vertex>> {
        let jets = self.surface.row_space_jets(row).into_iter().enumerate();
        jets.map(|(col, jet)| {
            let known = !self.surface.is_void(col, row) && jet.point.is_finite();
            known.then(|| Vertex {
                at: camera.project(jet.point),
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

/// Number of cells along a direction with so many nodes.
fn cells(nodes: usize, periodic: bool) -> usize {
    if periodic { nodes } else { nodes - 1 }
}

/// Pictures side by side, from left to right, on white.
///
/// # Errors
/// [`Error::Argument`] if there is none or they are too large together.
pub fn side_by_side(pictures: &[RgbaImage]) -> Result<RgbaImage> {
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
        assert_eq!(side_by_side(&[one.clone(), one.clone()]).unwrap().width(), 2 * one.width());
        assert!(SurfacePicture::new(&tube, &colours[1..]).render().is_err());
        assert!(
            SurfacePicture { view: DVec3::ZERO, ..SurfacePicture::new(&tube, &colours) }
                .png()
                .is_err()
        );
        assert!(side_by_side(&[]).is_err());
    }
}
