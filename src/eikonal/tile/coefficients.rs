//! What the update needs of the speed tensors.

#![allow(clippy::needless_range_loop, reason = "lanes of several arrays go together")]

use glam::DVec2;

use super::kernel::How;
use super::{Limits, Tile};
use crate::eikonal::cone::Cone;
use crate::eikonal::field::SIDE;
use crate::eikonal::stencil::UNREACHED;
use crate::eikonal::stencil::ring::RING;
use crate::linalg::Sym2;
use crate::linalg::lanes::{choose, greatest, lanes, least};

/// What the update needs of `D` at the [`SIDE`] nodes of a row.
///
/// For a triangle with axis neighbour `a` and diagonal neighbour `b`, `w = b − a`, `d = gb − ga`, let `D = [s β; β q]` in the
/// basis `(a, w)`. The eikonal equation `s t² − 2β t d + q d² = 1`, `t = u − ga`, has the causal root
///
/// ```text
///   t(d) = (β/s) d + √(1/s − (det D/s²) d²)
/// ```
///
/// It is the least over the segment where the slope of the sum (see [`segment`]) changes sign between the ends:
/// `lo ≤ d ≤ hi` with `lo = −bᵀMw/‖b‖`, `hi = −aᵀMw/‖a‖`. Outside, the least is at an end.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Coefficients {
    /// `1/s`, `det D/s²` and `β/s` for triangles along x, then along y; `β` changes its sign in the other two quadrants.
    pub(crate) ix: [f32; SIDE],
    pub(crate) ex: [f32; SIDE],
    pub(crate) bx: [f32; SIDE],
    pub(crate) iy: [f32; SIDE],
    pub(crate) ey: [f32; SIDE],
    pub(crate) by: [f32; SIDE],
    /// `hi` along x and y; with the other sign in the other two quadrants.
    pub(crate) hx: [f32; SIDE],
    pub(crate) hy: [f32; SIDE],
    /// `lo` of the triangles with a diagonal (1,1) along x and y, then with (1,−1).
    pub(crate) rx: [f32; SIDE],
    pub(crate) ry: [f32; SIDE],
    pub(crate) fx: [f32; SIDE],
    pub(crate) fy: [f32; SIDE],
    /// Lengths of the steps (1,0), (0,1), (1,1), (1,−1).
    pub(crate) east: [f32; SIDE],
    pub(crate) south: [f32; SIDE],
    pub(crate) rising: [f32; SIDE],
    pub(crate) falling: [f32; SIDE],
    /// A change below this is no reason to go on.
    pub(crate) tolerance: [f32; SIDE],
    /// The node is only lowered to below this: infinite but for nodes of the start.
    pub(crate) ceiling: [f32; SIDE],
}

impl Coefficients {
    /// Nodes that are never updated: all steps are endless.
    pub(crate) const CLOSED: Self = Self {
        ix: [f32::INFINITY; SIDE],
        ex: [0.0; SIDE],
        bx: [0.0; SIDE],
        iy: [f32::INFINITY; SIDE],
        ey: [0.0; SIDE],
        by: [0.0; SIDE],
        hx: [0.0; SIDE],
        hy: [0.0; SIDE],
        rx: [0.0; SIDE],
        ry: [0.0; SIDE],
        fx: [0.0; SIDE],
        fy: [0.0; SIDE],
        east: [f32::INFINITY; SIDE],
        south: [f32::INFINITY; SIDE],
        rising: [f32::INFINITY; SIDE],
        falling: [f32::INFINITY; SIDE],
        tolerance: [f32::INFINITY; SIDE],
        ceiling: [f32::INFINITY; SIDE],
    };
}

/// [`Limits`] of the nodes in each lane; their greatest at once would be a chain of comparisons, one after the other.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct LaneLimits {
    slack: [f32; SIDE],
    /// By how much a cone lowers a neighbour's value at most.
    shift: [f32; SIDE],
    longest_step: [f32; SIDE],
}

impl LaneLimits {
    /// Those of all nodes.
    pub(crate) fn of_all(&self) -> Limits {
        let all = |lanes: &[f32; SIDE]| lanes.iter().copied().fold(0.0, greatest);
        Limits { slack: all(&self.slack) + all(&self.shift), longest_step: all(&self.longest_step) }
    }
}

/// The tensors of one line of a tile: `xx`, `xy` and the determinant.
#[inline(always)]
pub(crate) fn tensors(tile: &Tile<'_>, line: usize, how: How) -> [[f32; SIDE]; 3] {
    let all = tile.tensors;
    if !how.by_columns {
        let place = line * SIDE;
        return [lanes(&all.xx, place), lanes(&all.xy, place), lanes(&all.det, place)];
    }
    let (mut xx, mut xy, mut det) = ([0f32; SIDE], [0f32; SIDE], [0f32; SIDE]);
    for i in 0..SIDE {
        let place = i * SIDE + line;
        (xx[i], xy[i], det[i]) = (all.xx[place], all.xy[place], all.det[place]);
    }
    for i in 0..SIDE {
        xx[i] = (det[i] + xy[i] * xy[i]) / xx[i];
    }
    [xx, xy, det]
}

/// The coefficients of one line of a tile. `D` is stored as (xx, xy, det): the determinant of a very anisotropic
/// tensor would be lost in the rounding of xx·yy − xy².
#[inline(always)]
pub(crate) fn prepare(
    tile: &Tile<'_>,
    line: usize,
    how: How,
    k: &mut Coefficients,
    limits: &mut LaneLimits,
) {
    let [xxs, xys, dets] = tensors(tile, line, how);
    let (mut slack, mut longest) = ([0f32; SIDE], [0f32; SIDE]);
    for i in 0..SIDE {
        let (xx, xy, det) = (xxs[i], xys[i], dets[i]);
        let open = det > 0.0;
        let ix = 1.0 / xx;
        let yy = (det + xy * xy) * ix;
        let (iy, idet) = (1.0 / yy, 1.0 / det);
        let (east, south) = ((yy * idet).sqrt(), (xx * idet).sqrt());
        let rising2 = greatest(xx + yy - 2.0 * xy, 1e-30) * idet;
        let falling2 = greatest(xx + yy + 2.0 * xy, 1e-30) * idet;
        let (rising, falling) = (rising2.sqrt(), falling2.sqrt());
        let (irising, ifalling) = (idet / rising, idet / falling);
        let shortest = least(least(east, south), least(rising, falling));
        k.ix[i] = choose(open, ix, f32::INFINITY);
        k.ex[i] = choose(open, det * ix * ix, 0.0);
        k.bx[i] = choose(open, xy * ix, 0.0);
        k.iy[i] = choose(open, iy, f32::INFINITY);
        k.ey[i] = choose(open, det * iy * iy, 0.0);
        k.by[i] = choose(open, xy * iy, 0.0);
        k.hx[i] = choose(open, xy * east * iy, 0.0);
        k.hy[i] = choose(open, xy * south * ix, 0.0);
        k.rx[i] = choose(open, (xy - xx) * irising, 0.0);
        k.ry[i] = choose(open, (xy - yy) * irising, 0.0);
        k.fx[i] = choose(open, -(xx + xy) * ifalling, 0.0);
        k.fy[i] = choose(open, -(yy + xy) * ifalling, 0.0);
        k.east[i] = choose(open, east, f32::INFINITY);
        k.south[i] = choose(open, south, f32::INFINITY);
        k.rising[i] = choose(open, rising, f32::INFINITY);
        k.falling[i] = choose(open, falling, f32::INFINITY);
        k.tolerance[i] = choose(open, tile.tolerance * shortest, f32::INFINITY);
        // A closed node never changes: at the seam of a periodic grid it stands for one of another tile.
        k.ceiling[i] = choose(open, f32::INFINITY, f32::NEG_INFINITY);
        let obtuse = greatest(
            greatest(k.hx[i].abs() - east, k.hy[i].abs() - south),
            greatest(
                greatest(-k.rx[i] - rising, -k.ry[i] - rising),
                greatest(-k.fx[i] - falling, -k.fy[i] - falling),
            ),
        );
        slack[i] = choose(open, obtuse, 0.0);
        longest[i] = choose(open, greatest(rising, falling), 0.0);
    }
    // In a loop of its own, or the limits are scattered lane by lane.
    for i in 0..SIDE {
        limits.slack[i] = greatest(limits.slack[i], slack[i]);
        limits.longest_step[i] = greatest(limits.longest_step[i], longest[i]);
    }
    if let Some(seeds) = tile.seeds {
        for i in 0..SIDE {
            let place = if how.by_columns { i * SIDE + line } else { line * SIDE + i };
            let shortest = least(least(k.east[i], k.south[i]), least(k.rising[i], k.falling[i]));
            k.ceiling[i] = least(k.ceiling[i], ceiling(seeds[place], shortest));
        }
    }
}

/// [`Cone::shift`] for the nodes of one line.
#[inline(always)]
pub(crate) fn prepare_shifts(
    tile: &Tile<'_>,
    line: usize,
    how: How,
    shifts: &mut [[f32; SIDE]; 8],
    limits: &mut LaneLimits,
) {
    let Some((cone, first)) = tile.cone else { return };
    let turn = |v: DVec2| if how.by_columns { DVec2::new(v.y, v.x) } else { v };
    let from = turn(first - cone.at);
    let (m, sides) = (cone.metric, cone.sides.map(turn));
    let m = if how.by_columns { Sym2::new(m.yy, m.xy, m.xx) } else { m };
    let [p, q] = sides.map(|side| m.apply(side));
    let (xx, xy, yy) = (m.xx as f32, m.xy as f32, m.yy as f32);
    let (px, py, qx, qy) = (p.x as f32, p.y as f32, q.x as f32, q.y as f32);
    let det0 = m.det() as f32;
    let (radius2, alike2) = ((cone.radius * cone.radius) as f32, (cone.alike * cone.alike) as f32);
    let y = (from.y + line as f64) as f32;
    let [dxx, dxy, ddet] = tensors(tile, line, how);
    let mut largest = [0f32; SIDE];
    for i in 0..SIDE {
        // Rounded once, so that rows and columns agree on which nodes the cone reaches.
        let x = (from.x + i as f64) as f32;
        let r2 = x * x + y * y;
        let (mx, my) = (xx * x + xy * y, xy * x + yy * y);
        let g2 = greatest(mx * x + my * y, 0.0);
        let g = g2.sqrt();
        let share = choose(g > 0.0, 1.0 / g, 0.0);
        for k in 0..8 {
            let (dx, dy) = (RING[k].0 as f32, RING[k].1 as f32);
            let a = mx * dx + my * dy;
            let b = xx * (dx * dx) + 2.0 * xy * (dx * dy) + yy * (dy * dy);
            let sum = g + greatest(g2 + (2.0 * a + b), 0.0).sqrt();
            let isum = choose(sum > 0.0, 1.0 / sum, 0.0);
            let holds =
                (px * (x + dx) + py * (y + dy) <= 0.0) & (qx * (x + dx) + qy * (y + dy) <= 0.0);
            shifts[k][i] = choose(holds, (a * (2.0 * a + b) * isum - g * b) * (isum * share), 0.0);
            largest[i] = greatest(largest[i], -shifts[k][i]);
        }
        let dyy = (ddet[i] + dxy[i] * dxy[i]) / dxx[i];
        let trace = xx * dxx[i] + 2.0 * xy * dxy[i] + yy * dyy;
        let applies = (px * x + py * y <= 0.0)
            & (qx * x + qy * y <= 0.0)
            & (r2 <= radius2)
            & ((r2 <= alike2) | Cone::applies(trace, ddet[i] * det0, dxx[i] + dyy, largest[i]));
        limits.shift[i] = greatest(limits.shift[i], choose(applies, largest[i], 0.0));
        for k in 0..8 {
            shifts[k][i] = choose(applies, shifts[k][i], 0.0);
        }
    }
}

/// What a node of the start has to be lowered to below, if ever. The values near the start are of second order, the update is
/// only of first and may lie below them; one that is lower by half a step is from another start. Infinite
/// for other nodes.
#[inline(always)]
pub(crate) fn ceiling(seed: f32, shortest_step: f32) -> f32 {
    choose(seed < UNREACHED, seed - 0.5 * shortest_step, f32::INFINITY)
}
