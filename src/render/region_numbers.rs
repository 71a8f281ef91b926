//! The number of each region, written where the region has most room.

use glam::{DVec2, Vec2};

use super::canvas::Canvas;
use super::colour::Rgb;
use super::text;

/// No number is smaller than this in any picture, pixels.
const LEGIBLE: f32 = 10.0;

/// Writes the number of each region, counted from 1, into the middle of the largest square within it, if that is large enough. `pixels`
/// are the regions of a part of the canvas `width` pixels wide, with its corner at `left`, `top`; sizes are between `largest` and half of it.
pub(super) fn draw_numbers(
    canvas: &mut Canvas,
    pixels: &[Option<u32>],
    [left, top, width]: [usize; 3],
    largest: f32,
) {
    for (region, square) in largest_squares(pixels, width).into_iter().enumerate() {
        let number = (region + 1).to_string();
        // Half of the text per pixel of its size; half of DejaVu's capital height, 0.729 em, centres it.
        let half = Vec2::new(0.5 * text::width(&number, 1.0), 0.365);
        let size = largest.min(0.9 * square.half / half.max_element());
        if size >= LEGIBLE.max(0.5 * largest) {
            let middle = square.middle + Vec2::new(left as f32, top as f32);
            let baseline = middle + size * Vec2::new(-half.x, half.y);
            canvas.text(&number, size, baseline, Rgb::INK, largest / 12.0);
        }
    }
}

/// A square of pixels of one region, in pixels.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Square {
    middle: Vec2,
    /// Half of its side; 0 if the region has no pixel.
    half: f32,
}

/// The largest square within each region, on rows of `width` pixels; of equal ones that nearest to the centroid. So it lies in the region also
/// where the centroid does not.
fn largest_squares(pixels: &[Option<u32>], width: usize) -> Vec<Square> {
    let reach = chessboard_distances(pixels, width);
    let count = pixels.iter().flatten().max().map_or(0, |&last| last as usize + 1);
    let labelled =
        || pixels.iter().enumerate().filter_map(|(i, region)| Some((i, (*region)? as usize)));
    let mut sums = vec![(DVec2::ZERO, 0.0); count];
    for (i, region) in labelled() {
        sums[region].0 += centre(i, width);
        sums[region].1 += 1.0;
    }
    let mut squares = vec![Square::default(); count];
    for (i, region) in labelled() {
        let (centroid, middle) = (sums[region].0 / sums[region].1, centre(i, width));
        let (square, half) = (&mut squares[region], reach[i] as f32 - 0.5);
        let is_nearer =
            middle.distance_squared(centroid) < square.middle.as_dvec2().distance_squared(centroid);
        if half > square.half || (half == square.half && is_nearer) {
            *square = Square { middle: middle.as_vec2(), half };
        }
    }
    squares
}

/// The centre of pixel `i` on rows of `width` pixels.
fn centre(i: usize, width: usize) -> DVec2 {
    DVec2::new((i % width) as f64, (i / width) as f64) + 0.5
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
        let at = |x: f32, y: f32, half| Square { middle: Vec2::new(x, y), half };
        // Region 0 is a C around 2, whose centroid is in 2; region 2 a ring around 1, widest in the west.
        let squares = largest_squares(&pixels, 10);
        assert_eq!(
            squares,
            [at(1.5, 4.5, 1.5), at(7.5, 4.5, 1.5), at(4.5, 4.5, 1.5), at(9.5, 7.5, 0.5)]
        );
        assert!(super::largest_squares(&[None; 4], 2).is_empty());
    }
}
