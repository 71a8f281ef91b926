//! What is nearest to the viewer in each sample of a picture (a z-buffer, Catmull 1974).

use glam::{DVec2, DVec3};

use super::colour::Rgb;
use crate::error::{Error, Result};

/// Samples along each side of a pixel.
const SAMPLES: usize = 2;
/// Share of the picture around the surface.
const MARGIN: f64 = 0.04;
/// A line is drawn this share of the surface's size before it, so that the surface's own pieces do not hide it.
const LIFT: f64 = 0.005;

/// A node of the surface as it is seen.
#[derive(Clone, Copy)]
pub(super) struct Vertex {
    /// Right, down, towards the viewer.
    pub(super) at: DVec3,
    /// Brightness, 0 to 1.
    pub(super) light: f64,
    pub(super) colour: Rgb,
    pub(super) region: Option<u32>,
}

/// Samples of the picture, each with the depth of what was nearest so far.
pub(super) struct DepthBuffer {
    width: usize,
    height: usize,
    colours: Vec<Rgb>,
    depths: Vec<f64>,
    /// What region is seen; none on lines and points.
    regions: Vec<Option<u32>>,
    /// Samples per metre, and where sample 0, 0 lies.
    scale: f64,
    origin: DVec2,
    size: f64,
}

impl DepthBuffer {
    /// White, with room for all `nodes` in a picture of `side` pixels along its longer side.
    pub(super) fn new(nodes: &[Option<Vertex>], side: u32) -> Result<Self> {
        let points = || nodes.iter().flatten().map(|vertex| vertex.at);
        let least = points().fold(DVec3::INFINITY, DVec3::min);
        let most = points().fold(DVec3::NEG_INFINITY, DVec3::max);
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

    /// A point in samples.
    fn to_samples(&self, at: DVec3) -> DVec2 {
        (at.truncate() - self.origin) * self.scale
    }

    /// The sample in a column and a row, if what is `depth` near there is nearest so far.
    fn nearest(&mut self, x: usize, y: usize, depth: f64) -> Option<usize> {
        let i = y * self.width + x;
        if x >= self.width || y >= self.height || depth <= self.depths[i] {
            return None;
        }
        self.depths[i] = depth;
        Some(i)
    }

    /// A triangle whose colours are interpolated between the corners (`blend`), or each in the part nearest to its corner.
    pub(super) fn triangle(&mut self, corners: [Vertex; 3], blend: bool) {
        let samples = corners.map(|corner| self.to_samples(corner.at));
        let [a, b, c] = samples;
        if (b - a).perp_dot(c - a) == 0.0 {
            return;
        }
        let (least, most) = (a.min(b).min(c).ceil(), a.max(b).max(c));
        for y in least.y as usize..=most.y as usize {
            for x in least.x as usize..=most.x as usize {
                let Some(weights) = barycentric(samples, DVec2::new(x as f64, y as f64)) else {
                    continue;
                };
                let depth = mean(weights, &corners, |corner| corner.at.z);
                let Some(sample) = self.nearest(x, y, depth) else { continue };
                let closest =
                    (1..3).fold(0, |best, i| if weights[i] > weights[best] { i } else { best });
                let colour =
                    if blend { mean_colour(weights, &corners) } else { corners[closest].colour };
                let light = mean(weights, &corners, |corner| corner.light);
                self.colours[sample] = Rgb(0, 0, 0).mix(colour, light);
                self.regions[sample] = corners[closest].region;
            }
        }
    }

    /// A line of colour that faces the viewer.
    pub(super) fn line(&mut self, from: DVec3, to: DVec3, colour: Rgb) {
        let steps = self.to_samples(from).distance(self.to_samples(to)).ceil().clamp(1.0, 1e5);
        for i in 0..=steps as usize {
            self.disc(from.lerp(to, i as f64 / steps), 1.2, colour);
        }
    }

    /// A disc of `radius` pixels that faces the viewer, a little before the surface.
    pub(super) fn disc(&mut self, at: DVec3, radius: f64, colour: Rgb) {
        let radius = radius * SAMPLES as f64;
        let (centre, depth) = (self.to_samples(at), at.z + LIFT * self.size);
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

    /// Width and height in pixels.
    pub(super) fn size(&self) -> [usize; 2] {
        [self.width / SAMPLES, self.height / SAMPLES]
    }

    /// The colour of a pixel: the mean of its samples.
    pub(super) fn colour(&self, x: usize, y: usize) -> Rgb {
        let samples = (0..SAMPLES * SAMPLES).map(|k| {
            let (i, j) = (x * SAMPLES + k % SAMPLES, y * SAMPLES + k / SAMPLES);
            self.colours[j * self.width + i]
        });
        let sums = samples.fold([0; 3], |[r, g, b], c| {
            [r + u32::from(c.0), g + u32::from(c.1), b + u32::from(c.2)]
        });
        let [r, g, b] = sums.map(|sum| (sum / (SAMPLES * SAMPLES) as u32) as u8);
        Rgb(r, g, b)
    }

    /// The region seen in each pixel, row-major.
    pub(super) fn regions(&self) -> Vec<Option<u32>> {
        let [width, height] = self.size();
        (0..width * height)
            .map(|i| self.regions[i / width * SAMPLES * self.width + i % width * SAMPLES])
            .collect()
    }
}

/// The mean of a quantity of the corners of a triangle, weighted by `weights`.
fn mean(weights: [f64; 3], corners: &[Vertex; 3], of: impl Fn(&Vertex) -> f64) -> f64 {
    weights.iter().zip(corners).map(|(weight, corner)| weight * of(corner)).sum()
}

fn mean_colour(weights: [f64; 3], corners: &[Vertex; 3]) -> Rgb {
    let channel = |of: fn(Rgb) -> u8| mean(weights, corners, |c| of(c.colour).into()).round() as u8;
    Rgb(channel(|c| c.0), channel(|c| c.1), channel(|c| c.2))
}

/// The barycentric coordinates of a point, one for each corner; `None` outside the triangle.
fn barycentric([a, b, c]: [DVec2; 3], p: DVec2) -> Option<[f64; 3]> {
    let area = (b - a).perp_dot(c - a);
    let weights = [(b - p).perp_dot(c - p), (c - p).perp_dot(a - p), (a - p).perp_dot(b - p)]
        .map(|weight| weight / area);
    (!weights.iter().any(|&weight| weight < 0.0)).then_some(weights)
}
