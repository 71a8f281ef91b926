//! Where each value came from, as the nearest node of the ring.

#![allow(clippy::needless_range_loop, reason = "lanes of several arrays go together")]

use multiversion::multiversion;
use rayon::prelude::*;

use super::board::Board;
use super::cone::Cones;
use super::field::{SIDE, TensorField};
use super::stencil::UNREACHED;
use super::stencil::ring::pass;
use super::tile::coefficients::{Coefficients, LaneLimits, prepare, prepare_shifts, tensors};
use super::tile::kernel::{How, triangle};
use super::tile::{Block, Tile};
use super::tiles::Values;
use crate::linalg::lanes::{lanes, least};

/// No place on the ring.
pub(super) const NOWHERE: u8 = u8::MAX;

/// Of each node, row-major, the place on its [`RING`](super::stencil::ring::RING) that leads home: of the two ends of the segment that
/// its value came from, the one nearer to the point it came from; the other, if only that is lower than the node. [`NOWHERE`]
/// where not reached. Beside a cone taken out both may be higher; the nearer one still leads there.
pub(super) fn origins(field: &TensorField, cones: &Cones, values: Values) -> Vec<u8> {
    let tiling = field.tiling;
    let board = Board::new(values, f32::INFINITY);
    let mut origins = vec![NOWHERE; tiling.cols * tiling.rows];
    let bands = origins.par_chunks_mut((tiling.cols * SIDE).max(1)).enumerate();
    bands.for_each_init(Block::default, |block, (y, band)| {
        for x in 0..tiling.across {
            let index = y * tiling.across + x;
            let cone = cones.of_tile(index).map(|cone| (cone, tiling.first(index)));
            let tile = Tile { tensors: &field.tiles[index], cone, tolerance: 0.0, seeds: None };
            board.load(index, block);
            let [cols, _] = tiling.size(index);
            for (line, origins) in band.chunks_mut(tiling.cols).zip(of_tile(block, &tile)) {
                line[x * SIDE..][..cols].copy_from_slice(&origins[..cols]);
            }
        }
    });
    origins
}

#[multiversion(targets(
    "x86_64+avx512f+avx512bw+avx512cd+avx512dq+avx512vl",
    "x86_64+avx2",
    "x86_64+sse4.1",
))]
fn of_tile(block: &Block, tile: &Tile<'_>) -> [[u8; SIDE]; SIDE] {
    let mut origins = [[NOWHERE; SIDE]; SIDE];
    for row in 0..SIDE {
        let line = match tile.cone {
            Some(_) => of_line::<true>(block, tile, row),
            None => of_line::<false>(block, tile, row),
        };
        for i in 0..SIDE {
            origins[row][i] = line[i] as u8;
        }
    }
    origins
}

#[inline(always)]
fn of_line<const IN_CONE: bool>(block: &Block, tile: &Tile<'_>, row: usize) -> [u32; SIDE] {
    let how = How { by_columns: false, descending: false };
    let (mut k, mut limits) = (Coefficients::CLOSED, LaneLimits::default());
    prepare(tile, row, how, &mut k, &mut limits);
    let mut shifts = [[0f32; SIDE]; 8];
    if IN_CONE {
        prepare_shifts(tile, row, how, &mut shifts, &mut limits);
    }
    let [xxs, xys, dets] = tensors(tile, row, how);
    let (above, here, below) = (&block[row], &block[row + 1], &block[row + 2]);
    let (own, east, west) = (lanes(here, 1), lanes(here, 2), lanes(here, 0));
    let (south, north) = (lanes(below, 1), lanes(above, 1));
    let (south_east, north_west) = (lanes(below, 2), lanes(above, 0));
    let (north_east, south_west) = (lanes(above, 2), lanes(below, 0));
    let mut origins = [u32::from(NOWHERE); SIDE];
    for i in 0..SIDE {
        let (e, w, s, n) = (east[i], west[i], south[i], north[i]);
        let (se, nw) = (pass(south_east[i], s, e), pass(north_west[i], n, w));
        let (ne, sw) = (pass(north_east[i], n, e), pass(south_west[i], s, w));
        let ring = [e, se, s, sw, w, nw, n, ne];
        let mut g = ring;
        if IN_CONE {
            for k in 0..8 {
                g[k] += shifts[k][i];
            }
        }
        let (mut value, mut origin) = (UNREACHED, u32::from(NOWHERE));
        let steps = [k.east[i], k.rising[i], k.south[i], k.falling[i]];
        for k in 0..8 {
            let through = g[k] + steps[k % 4];
            origin = if through < value { k as u32 } else { origin };
            value = least(through, value);
        }
        // The point is nearer to `b` where the slope of the sum, see `segment`, is negative in the middle `m` of the segment:
        // where `d < −mᵀMw/‖m‖`.
        let (xx, xy, det) = (xxs[i], xys[i], dets[i]);
        let yy = (det + xy * xy) / xx;
        let middle =
            |xx: f32, yy: f32, xy: f32| (xy - 0.5 * xx) / ((yy - xy + 0.25 * xx) * det).sqrt();
        let mut offer = |a: usize, b: usize, lo: f32, hi: f32, root: [f32; 3], middle: f32| {
            let through = triangle(g[a], g[b], lo, hi, root);
            let near_b = g[b] - g[a] < middle;
            let (a_lower, b_lower) = (ring[a] < own[i], ring[b] < own[i]);
            let to_b = (near_b & (b_lower | !a_lower)) | (b_lower & !a_lower);
            let to = if to_b { b as u32 } else { a as u32 };
            origin = if through < value { to } else { origin };
            value = least(through, value);
        };
        let x = [k.ix[i], k.ex[i], k.bx[i]];
        let y = [k.iy[i], k.ey[i], k.by[i]];
        let (lo, hi, m) = (k.rx[i], k.hx[i], middle(xx, yy, xy));
        offer(0, 1, lo, hi, x, m);
        offer(4, 5, lo, hi, x, m);
        let (lo, hi, m) = (k.ry[i], k.hy[i], middle(yy, xx, xy));
        offer(2, 1, lo, hi, y, m);
        offer(6, 5, lo, hi, y, m);
        let x = [k.ix[i], k.ex[i], -k.bx[i]];
        let y = [k.iy[i], k.ey[i], -k.by[i]];
        let (lo, hi, m) = (k.fx[i], -k.hx[i], middle(xx, yy, -xy));
        offer(0, 7, lo, hi, x, m);
        offer(4, 3, lo, hi, x, m);
        let (lo, hi, m) = (k.fy[i], -k.hy[i], middle(yy, xx, -xy));
        offer(2, 3, lo, hi, y, m);
        offer(6, 7, lo, hi, y, m);
        origins[i] = if own[i] < UNREACHED { origin } else { u32::from(NOWHERE) };
    }
    origins
}

#[cfg(test)]
mod tests {
    use glam::DVec2;

    use super::super::stencil::ring::RING;
    use super::*;
    use crate::control::Control;
    use crate::eikonal::{Solver, Stop};
    use crate::linalg::Sym2;

    #[test]
    fn origins_are_the_ends_nearest_to_the_feet() {
        let tensor = |col: usize, row: usize| {
            let (sin, cos) = (0.1 * col as f64 + 0.07 * row as f64).sin_cos();
            let along = Sym2::new(cos * cos, sin * cos, sin * sin);
            (!(col * 7 + row * 13).is_multiple_of(29))
                .then(|| along * 0.9 + Sym2::new(0.1, 0.0, 0.1))
        };
        for periodic in [[false, false], [true, false]] {
            let control = Control::default();
            let field = TensorField::from_fn(50, 40, tensor, &control).unwrap();
            let field = field.periodic(periodic).unwrap();
            let start = DVec2::new(20.3, 17.6).into();
            let map = Solver::default().solve_field(field, &[start], &Stop::Never, &control);
            let map = map.unwrap();
            let (mut reached, mut nearest) = (0, 0);
            for (node, origin) in
                origins(&map.field, &map.cones, map.values.clone()).into_iter().enumerate()
            {
                let (col, row) = (node % map.cols(), node / map.cols());
                if !map.is_reached(col, row) {
                    assert_eq!(origin, NOWHERE);
                    continue;
                }
                let (_, foot) = map.best_foot(col, row).unwrap();
                let (i, j) = RING[usize::from(origin)];
                let away = (DVec2::new(i.into(), j.into()) - foot).abs().max_element();
                assert!(away <= 1.0, "({col}, {row}): {origin}, {foot}");
                reached += 1;
                nearest += usize::from(away <= 0.501);
            }
            // Of the rest only the other end is lower than the node.
            assert!(reached > 1800 && nearest * 20 > reached * 19, "{nearest} of {reached}");
        }
    }
}
