//! Shaded relief with a light tint of height: the ground of a map.

use glam::{DVec2, DVec3, Vec4};
use rayon::prelude::*;

use super::colour::Rgb;
use crate::grid::GridFrame;

/// Tint from the lowest to the highest ground. Pale and little saturated, so that lines stand out.
const TINT: [Rgb; 5] = [
    Rgb(0xc9, 0xd6, 0xbd),
    Rgb(0xe4, 0xe2, 0xc8),
    Rgb(0xe6, 0xd8, 0xbd),
    Rgb(0xdd, 0xd2, 0xc8),
    Rgb(0xf6, 0xf5, 0xf3),
];
/// Ground that is not known, and the hatching on it.
pub(super) const VOID: [Rgb; 2] = [Rgb(0xdc, 0xdc, 0xdc), Rgb(0xc2, 0xc2, 0xc2)];
/// Root-mean-square slope (rise over run) that heights are exaggerated to: gentle land then shows
/// its forms and steep land does not drown in shadow.
const SLOPE_SHOWN: f64 = 0.4;
/// Most and least exaggeration: beyond, the noise of flat land would look like mountains.
const EXAGGERATION: [f64; 2] = [0.3, 8.0];
/// Direction to the light, north-west at 45° (east, north, up): the cartographer's convention.
const LIGHT: DVec3 = DVec3::new(-0.5, 0.5, std::f64::consts::FRAC_1_SQRT_2);
/// Share of the light that comes from the zenith, which keeps form in the shadows.
const ZENITH: f64 = 0.3;

/// Colours at the points of a grid, coarsened where the picture shows less.
pub(super) struct Relief {
    cols: usize,
    rows: usize,
    /// Nodes of the original grid per point, along each side.
    block: usize,
    /// Red, green, blue and 1, or all zero where void: sums of these weigh the known points only.
    colours: Vec<Vec4>,
}

impl Relief {
    /// The relief of `heights` (metres, row-major, `NaN` where void) for a picture whose longer side
    /// has `side` pixels.
    pub(super) fn new(frame: &GridFrame, heights: &[f64], side: usize) -> Self {
        let block = (frame.cols().max(frame.rows()) / side.max(1)).max(1);
        let [cols, rows] = [frame.cols(), frame.rows()].map(|n| n.div_ceil(block));
        let means = block_means(frame, heights, block);
        let spacing: Vec<DVec2> =
            (0..rows).map(|row| block as f64 * frame.spacing((row * block) as f64)).collect();
        let gradients: Vec<DVec2> = (0..cols * rows)
            .into_par_iter()
            .map(|i| gradient(&means, cols, rows, i, spacing[i / cols]))
            .collect();

        let [low, high] = known(&means)
            .fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], h| [a.min(h), b.max(h)]);
        let exaggeration = exaggeration(&gradients, known(&means).count());
        let points = means.par_iter().zip(&gradients);
        let colours = points.map(|(h, &gradient)| {
            if !h.is_finite() {
                return Vec4::ZERO;
            }
            let height = if high > low { (h - low) / (high - low) } else { 0.5 };
            let Rgb(r, g, b) = shaded(tint(height), brightness(gradient * exaggeration));
            Vec4::new(r.into(), g.into(), b.into(), 1.0)
        });
        Self { cols, rows, block, colours: colours.collect() }
    }

    /// The colour at grid coordinates of the original grid, bilinear between the known points around;
    /// `None` if the nearest point is void.
    pub(super) fn at(&self, grid: DVec2) -> Option<Rgb> {
        let centre = (self.block as f64 - 1.0) / 2.0;
        let last = DVec2::new((self.cols - 1) as f64, (self.rows - 1) as f64);
        let p = ((grid - centre) / self.block as f64).clamp(DVec2::ZERO, last);
        let colour = |col: f64, row: f64| self.colours[row as usize * self.cols + col as usize];
        let nearest = p.round();
        if colour(nearest.x, nearest.y).w == 0.0 {
            return None;
        }
        let low = p.floor();
        let high = (low + DVec2::ONE).min(last);
        let t = (p - low).as_vec2();
        let north = colour(low.x, low.y).lerp(colour(high.x, low.y), t.x);
        let south = colour(low.x, high.y).lerp(colour(high.x, high.y), t.x);
        let sum = north.lerp(south, t.y);
        let mean = sum / sum.w + 0.5;
        Some(Rgb(mean.x as u8, mean.y as u8, mean.z as u8))
    }
}

fn known(heights: &[f64]) -> impl Iterator<Item = f64> {
    heights.iter().copied().filter(|h| h.is_finite())
}

/// Factor on the slopes of `known` points that makes their root mean square [`SLOPE_SHOWN`]; gradients are zero where
/// nothing is known.
fn exaggeration(gradients: &[DVec2], known: usize) -> f64 {
    let square: f64 = gradients.iter().map(|g| g.length_squared()).sum();
    let rms = (square / known.max(1) as f64).sqrt();
    let [least, most] = EXAGGERATION;
    if rms > 0.0 { (SLOPE_SHOWN / rms).clamp(least, most) } else { 1.0 }
}

/// Mean of the known heights of each block of `block × block` nodes.
fn block_means(frame: &GridFrame, heights: &[f64], block: usize) -> Vec<f64> {
    let cols = frame.cols().div_ceil(block);
    let count = cols * frame.rows().div_ceil(block);
    (0..count)
        .into_par_iter()
        .map(|i| {
            let (left, top) = (i % cols * block, i / cols * block);
            let (mut sum, mut known) = (0.0, 0u32);
            for row in top..(top + block).min(frame.rows()) {
                let line =
                    frame.index(left, row)..frame.index((left + block).min(frame.cols()), row);
                for h in heights[line].iter().filter(|h| h.is_finite()) {
                    sum += h;
                    known += 1;
                }
            }
            sum / f64::from(known)
        })
        .collect()
}

/// Rise per metre eastward and northward at point `i` by differences of the known neighbours; zero
/// along an axis where there is none.
fn gradient(heights: &[f64], cols: usize, rows: usize, i: usize, spacing: DVec2) -> DVec2 {
    let (col, row) = (i % cols, i / cols);
    let here = heights[i];
    if !here.is_finite() {
        return DVec2::ZERO;
    }
    let known = |there: bool, j: usize| there.then(|| heights[j]).filter(|h| h.is_finite());
    let west = known(col > 0, i.wrapping_sub(1));
    let east = known(col + 1 < cols, i + 1);
    let north = known(row > 0, i.wrapping_sub(cols));
    let south = known(row + 1 < rows, i + cols);
    DVec2::new(slope([west, east], here, spacing.x), slope([south, north], here, spacing.y))
}

/// Rise per metre between the known heights a step back and a step ahead, or from one of them to that between; 0 if none is known.
fn slope([back, ahead]: [Option<f64>; 2], here: f64, step: f64) -> f64 {
    let steps = usize::from(back.is_some()) + usize::from(ahead.is_some());
    let rise = ahead.unwrap_or(here) - back.unwrap_or(here);
    if steps == 0 { 0.0 } else { rise / (steps as f64 * step) }
}

/// Light that ground of slope `gradient` returns, 1 where level (Lambert's law).
fn brightness(gradient: DVec2) -> f64 {
    let normal = (-gradient).extend(1.0).normalize();
    (1.0 - ZENITH) * normal.dot(LIGHT).max(0.0) / LIGHT.z + ZENITH * normal.z
}

fn tint(height: f64) -> Rgb {
    let position = height.clamp(0.0, 1.0) * (TINT.len() - 1) as f64;
    let below = (position as usize).min(TINT.len() - 2);
    TINT[below].mix(TINT[below + 1], position - below as f64)
}

/// `colour` darker below brightness 1 and lighter above.
fn shaded(colour: Rgb, brightness: f64) -> Rgb {
    const SHADOW: Rgb = Rgb(0x38, 0x3c, 0x48);
    if brightness < 1.0 {
        colour.mix(SHADOW, 0.85 * (1.0 - brightness))
    } else {
        colour.mix(Rgb::WHITE, 1.2 * (brightness - 1.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grid::Ground;

    fn relief(cols: usize, rows: usize, side: usize, f: impl Fn(f64, f64) -> f64) -> Relief {
        let frame =
            GridFrame::new(cols, rows, DVec2::ZERO, DVec2::splat(10.0), Ground::METRES).unwrap();
        let heights: Vec<f64> =
            (0..cols * rows).map(|i| f((i % cols) as f64, (i / cols) as f64)).collect();
        Relief::new(&frame, &heights, side)
    }

    fn sum(colour: Option<Rgb>) -> u32 {
        let Rgb(r, g, b) = colour.unwrap();
        u32::from(r) + u32::from(g) + u32::from(b)
    }

    #[test]
    fn slopes_that_face_the_north_west_are_bright() {
        let cone = relief(41, 41, 1000, |x, y| -10.0 * (x - 20.0).hypot(y - 20.0));
        let north_west = cone.at(DVec2::splat(10.0));
        let south_east = cone.at(DVec2::splat(30.0));
        assert!(sum(north_west) > sum(south_east) + 100);
    }

    #[test]
    fn level_ground_returns_all_the_light() {
        assert!((brightness(DVec2::ZERO) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn voids_stay_voids_and_do_not_darken_their_neighbours() {
        let with_hole = relief(9, 9, 1000, |x, y| if x == 4.0 && y == 4.0 { f64::NAN } else { x });
        assert!(with_hole.at(DVec2::splat(4.2)).is_none());
        assert_eq!(with_hole.at(DVec2::new(3.4, 4.0)), with_hole.at(DVec2::new(3.0, 4.0)));
        assert!(relief(3, 3, 9, |_, _| f64::NAN).at(DVec2::ONE).is_none());
    }

    #[test]
    fn large_grids_are_coarsened() {
        let coarse = relief(1000, 10, 100, |x, _| x);
        assert_eq!((coarse.block, coarse.cols, coarse.rows), (10, 100, 1));
        assert!(sum(coarse.at(DVec2::new(999.0, 0.0))) > 0);
    }
}
