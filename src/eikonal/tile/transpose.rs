//! Tiles transposed, so that columns can be swept as rows are.

use glam::{Mat4, Vec4};

use crate::grid::tiling::{PADDED, PaddedTile, SIDE};

/// Side of the squares that are transposed in registers: number by number takes three times as long.
const SQUARE: usize = 4;

/// Transposes a tile and its halo.
pub(crate) fn transpose_block(block: &mut PaddedTile) {
    const LAST: usize = PADDED - 1;
    transpose(&mut block[1..LAST], 1);
    for i in 1..PADDED {
        swap(block, i, 0);
    }
    for i in 1..LAST {
        swap(block, LAST, i);
    }
}

fn swap(block: &mut PaddedTile, row: usize, col: usize) {
    let value = block[row][col];
    block[row][col] = block[col][row];
    block[col][row] = value;
}

/// Transposes a tile, the nodes of which begin at place `first` of the lines.
pub(crate) fn transpose<const N: usize>(lines: &mut [[f32; N]], first: usize) {
    for row in (0..SIDE).step_by(SQUARE) {
        for col in (0..=row).step_by(SQUARE) {
            let (here, there) = (square(lines, row, first + col), square(lines, col, first + row));
            put(lines, col, first + row, here.transpose());
            put(lines, row, first + col, there.transpose());
        }
    }
}

fn square<const N: usize>(lines: &[[f32; N]], row: usize, col: usize) -> Mat4 {
    let line = |i: usize| Vec4::from_slice(&lines[row + i][col..col + SQUARE]);
    Mat4::from_cols(line(0), line(1), line(2), line(3))
}

fn put<const N: usize>(lines: &mut [[f32; N]], row: usize, col: usize, square: Mat4) {
    for i in 0..SQUARE {
        square.col(i).write_to_slice(&mut lines[row + i][col..col + SQUARE]);
    }
}

#[cfg(test)]
mod tests {
    use std::array::from_fn;

    use super::*;

    #[test]
    fn transposes_all_of_a_block() {
        let block: PaddedTile = from_fn(|row| from_fn(|col| (100 * row + col) as f32));
        let mut transposed = block;
        transpose_block(&mut transposed);
        assert_eq!(transposed, from_fn(|row| from_fn(|col| block[col][row])));
    }
}
