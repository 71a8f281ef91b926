//! The coefficients of the update, computed from the speed tensors line by line.

#![allow(clippy::needless_range_loop, reason = "lanes of several arrays go together")]

use glam::{DVec2, Vec2Swizzles as _};

use super::{Limits, Tile};
use crate::eikonal::stencil::UNREACHED;
use crate::eikonal::stencil::ring::{Triangle, for_each_triangle};
use crate::eikonal::stencil::segment::ClosedForm;
use crate::grid::tiling::SIDE;
use crate::linalg::lanes::{Lanes, choose, greatest, lanes, least};

/// The coefficients of the update at the [`SIDE`] nodes of a line.
///
/// [`ClosedForm`] has the equation. `D = [xx xy; xy yy]` is at the same time `[s β; β q]` for `a = (1, 0)`, `b = (1, 1)`. The
/// triangles along y have x and y exchanged; those with the other diagonal have `β` and `hi` with the other sign.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Coefficients {
    /// Those of the triangles with the axis neighbour along x, and along y.
    along: [Along; 2],
    /// Lengths of the steps to the first four places of the ring; those to the opposite places are the same.
    pub(crate) step: [Lanes; 4],
    /// A smaller change does not count.
    pub(crate) tolerance: Lanes,
    /// The node is only lowered to values below this: infinite except at nodes of the start, see [`ceiling()`].
    pub(crate) ceiling: Lanes,
}

/// [`ClosedForm`] of the four triangles along an axis.
#[derive(Clone, Copy, Debug)]
struct Along {
    inv_s: Lanes,
    det_over_s2: Lanes,
    /// Both with the other sign where the diagonal is falling.
    beta_over_s: Lanes,
    hi: Lanes,
    lo_rising: Lanes,
    lo_falling: Lanes,
}

impl Along {
    /// Sets the coefficients of node `i` from `‖a‖`, and from `‖b‖` and `1/(det D ‖b‖)` of the rising diagonal and of the falling one. Returns
    /// how far the minimum over a segment may lie below the value at an end, see [`Limits::margin`].
    #[inline(always)]
    fn set(
        &mut self,
        i: usize,
        open: bool,
        [s, inv_s, inv_q]: [f32; 3],
        [beta, det]: [f32; 2],
        length_of_a: f32,
        [rising, inv_rising, falling, inv_falling]: [f32; 4],
    ) -> f32 {
        let hi = beta * length_of_a * inv_q;
        let (lo_rising, lo_falling) = ((beta - s) * inv_rising, -(s + beta) * inv_falling);
        self.inv_s[i] = choose(open, inv_s, f32::INFINITY);
        self.det_over_s2[i] = choose(open, det * inv_s * inv_s, 0.0);
        self.beta_over_s[i] = choose(open, beta * inv_s, 0.0);
        self.hi[i] = choose(open, hi, 0.0);
        self.lo_rising[i] = choose(open, lo_rising, 0.0);
        self.lo_falling[i] = choose(open, lo_falling, 0.0);
        greatest(hi.abs() - length_of_a, greatest(-lo_rising - rising, -lo_falling - falling))
    }
}

/// The speed tensors of a line of nodes: `xx`, `xy` and the determinant, 0 where closed. `xx·yy − xy²` would lose the determinant of a very
/// anisotropic tensor in rounding.
pub(crate) type LineTensors = [Lanes; 3];

impl Coefficients {
    /// Nodes that are never updated: all steps are infinite.
    pub(crate) const CLOSED: Self = {
        let (none, infinite) = ([0.0; SIDE], [f32::INFINITY; SIDE]);
        let along = Along {
            inv_s: infinite,
            det_over_s2: none,
            beta_over_s: none,
            hi: none,
            lo_rising: none,
            lo_falling: none,
        };
        Self { along: [along; 2], step: [infinite; 4], tolerance: infinite, ceiling: infinite }
    };

    /// Computes those of a line of a tile, a column where `by_columns`.
    #[inline(always)]
    pub(crate) fn prepare(
        &mut self,
        tile: &Tile<'_>,
        line: usize,
        by_columns: bool,
        [xxs, xys, dets]: &LineTensors,
        limits: &mut LaneLimits,
    ) {
        let (mut obtuse, mut longest) = ([0f32; SIDE], [0f32; SIDE]);
        let tolerance = tile.tolerance;
        for i in 0..SIDE {
            let (xx, xy, det) = (xxs[i], xys[i], dets[i]);
            let open = det > 0.0;
            let inv_xx = 1.0 / xx;
            let yy = (det + xy * xy) * inv_xx;
            let (inv_yy, inv_det) = (1.0 / yy, 1.0 / det);
            // M = D⁻¹ is [yy −xy; −xy xx]/det.
            let (east, south) = ((yy * inv_det).sqrt(), (xx * inv_det).sqrt());
            let rising = (greatest(xx + yy - 2.0 * xy, 1e-30) * inv_det).sqrt();
            let falling = (greatest(xx + yy + 2.0 * xy, 1e-30) * inv_det).sqrt();
            let (inv_rising, inv_falling) = (inv_det / rising, inv_det / falling);
            let [step_east, step_rising, step_south, step_falling] = &mut self.step;
            step_east[i] = choose(open, east, f32::INFINITY);
            step_rising[i] = choose(open, rising, f32::INFINITY);
            step_south[i] = choose(open, south, f32::INFINITY);
            step_falling[i] = choose(open, falling, f32::INFINITY);
            let [along_x, along_y] = &mut self.along;
            let diagonals = [rising, inv_rising, falling, inv_falling];
            let obtuse_x = along_x.set(i, open, [xx, inv_xx, inv_yy], [xy, det], east, diagonals);
            let obtuse_y = along_y.set(i, open, [yy, inv_yy, inv_xx], [xy, det], south, diagonals);
            obtuse[i] = choose(open, greatest(obtuse_x, obtuse_y), 0.0);
            let shortest = least(least(east, south), least(rising, falling));
            self.tolerance[i] = choose(open, tolerance * shortest, f32::INFINITY);
            // A closed node never changes: at the seam of a periodic grid it stands for one of another tile.
            self.ceiling[i] = choose(open, f32::INFINITY, f32::NEG_INFINITY);
            longest[i] = choose(open, greatest(rising, falling), 0.0);
        }
        // In a loop of its own, or the limits would be stored lane by lane.
        for i in 0..SIDE {
            limits.margin[i] = greatest(limits.margin[i], obtuse[i]);
            limits.longest_step[i] = greatest(limits.longest_step[i], longest[i]);
        }
        let Some(seeds) = tile.seeds else { return };
        for i in 0..SIDE {
            let place = if by_columns { i * SIDE + line } else { line * SIDE + i };
            let [east, rising, south, falling] = &self.step;
            let shortest = least(least(east[i], south[i]), least(rising[i], falling[i]));
            self.ceiling[i] = least(self.ceiling[i], ceiling(seeds[place], shortest));
        }
    }

    /// The update of node `i` through a triangle.
    #[inline(always)]
    pub(crate) fn closed_form(&self, t: Triangle, i: usize) -> ClosedForm {
        let along = &self.along[usize::from(t.along_y)];
        let (beta_over_s, hi) = (along.beta_over_s[i], along.hi[i]);
        ClosedForm {
            inv_s: along.inv_s[i],
            det_over_s2: along.det_over_s2[i],
            beta_over_s: if t.falling { -beta_over_s } else { beta_over_s },
            lo: if t.falling { along.lo_falling[i] } else { along.lo_rising[i] },
            hi: if t.falling { -hi } else { hi },
        }
    }

    /// The best value of node `i` over its ring: over the eight nodes, and between them over the eight segments.
    #[inline(always)]
    pub(crate) fn best(&self, ring: [f32; 8], i: usize) -> f32 {
        let [e, se, s, sw, w, nw, n, ne] = ring;
        let [east, rising, south, falling] = &self.step;
        let mut best = least(
            least(least(e, w) + east[i], least(s, n) + south[i]),
            least(least(se, nw) + rising[i], least(ne, sw) + falling[i]),
        );
        for_each_triangle!(t => best = least(best, self.closed_form(t, i).through(ring[t.a], ring[t.b])));
        best
    }

    /// `min(1/xx, 1/yy)/2` at node `i`: no step is shorter than its root.
    #[inline(always)]
    pub(crate) fn least_square_of_steps(&self, i: usize) -> f32 {
        0.5 * least(self.along[0].inv_s[i], self.along[1].inv_s[i])
    }
}

/// [`Limits`] of the nodes in each lane; a running maximum over all nodes would be one long chain of dependent comparisons.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct LaneLimits {
    margin: Lanes,
    /// By how much factoring lowers a neighbour's value at most.
    term: Lanes,
    longest_step: Lanes,
}

impl LaneLimits {
    /// The greatest over all lanes.
    pub(crate) fn of_all(&self) -> Limits {
        let all = |lanes: &Lanes| lanes.iter().copied().fold(0.0, greatest);
        Limits {
            margin: all(&self.margin) + all(&self.term),
            longest_step: all(&self.longest_step),
        }
    }
}

/// The tensors of one line of a tile.
#[inline(always)]
pub(crate) fn line_tensors(tile: &Tile<'_>, line: usize, by_columns: bool) -> LineTensors {
    let all = tile.tensors;
    if !by_columns {
        let first = line * SIDE;
        return [lanes(&all.xx, first), lanes(&all.xy, first), lanes(&all.det, first)];
    }
    let (mut xx, mut xy, mut det) = ([0f32; SIDE], [0f32; SIDE], [0f32; SIDE]);
    for i in 0..SIDE {
        let place = i * SIDE + line;
        (xx[i], xy[i], det[i]) = (all.xx[place], all.xy[place], all.det[place]);
    }
    // The `xx` of a column is the `yy` of rows.
    for i in 0..SIDE {
        xx[i] = (det[i] + xy[i] * xy[i]) / xx[i];
    }
    [xx, xy, det]
}

/// Computes the factoring terms at the nodes of one line of a tile: 0 without a factor.
#[inline(always)]
pub(crate) fn factoring_terms(
    tile: &Tile<'_>,
    line: usize,
    by_columns: bool,
    tensors: &LineTensors,
    terms: &mut [Lanes; 8],
    limits: &mut LaneLimits,
) {
    let Some((factor, first)) = tile.factor else {
        *terms = [[0.0; SIDE]; 8];
        return;
    };
    let (factor, first) =
        if by_columns { (factor.transposed(), first.yx()) } else { (*factor, first) };
    let from = (first - factor.at) + DVec2::new(0.0, line as f64);
    let largest = factor.terms_of_line(from, tensors, terms);
    for i in 0..SIDE {
        limits.term[i] = greatest(limits.term[i], largest[i]);
    }
}

/// The value below which a node of the start may be lowered; infinite for other nodes. Start values are of second order, while the
/// update is only of first order and may lie a little below them; one that is lower by half a step comes from another start.
#[inline(always)]
pub(crate) fn ceiling(seed: f32, shortest_step: f32) -> f32 {
    choose(seed < UNREACHED, seed - 0.5 * shortest_step, f32::INFINITY)
}
