//! The heart: sweeps over a tile until it stands still.
//!
//! Semi-Lagrangian update on the eight triangles around a node `x` (index units, spacing 1): the distance
//! at `x` is the least, over the ring of its neighbours, of the distance on the ring plus the length of the
//! straight step to it,
//!
//! ```text
//!   g(x) = min over y on the ring  of  g(y) + √((y−x)ᵀ M (y−x)),       M = D⁻¹ at x,
//!
//!     (−1,−1) ── (0,−1) ── (1,−1)
//!        │    ╲    │    ╱    │         g is linear along each of the
//!     (−1, 0) ──   x   ── (1, 0)       ring's eight segments
//!        │    ╱    │    ╲    │
//!     (−1, 1) ── (0, 1) ── (1, 1)
//! ```
//!
//! [`segment`](crate::eikonal::stencil::segment::segment) is that minimum over one segment in plain form; [`sweep`] is the closed
//! form over all eight at once, many nodes at a time.

#![allow(clippy::needless_range_loop, reason = "lanes of several arrays go together")]

use multiversion::multiversion;

use super::changes::{self, ROUNDING, lines_beside};
use super::coefficients::{Coefficients, LaneLimits, prepare, prepare_shifts};
use super::transpose::mirror_block;
use super::{ALL, BLOCK, Block, Limits, Lines, Rule, Tile};
use crate::eikonal::field::SIDE;
use crate::eikonal::stencil::UNREACHED;
use crate::eikonal::stencil::ring::{RING, pass};
use crate::linalg::lanes::{choose, greatest, lanes, least};

/// Sweeps of a tile after which it is given back, though it may not stand still.
const MAX_SWEEPS: u32 = 16;

/// A tile to be solved; its values are in the [`Workspace`].
#[derive(Clone, Copy, Debug)]
pub(crate) struct Problem<'a> {
    pub(crate) tile: Tile<'a>,
    pub(crate) rule: Rule,
    /// Columns and rows that lie in the grid.
    pub(crate) size: [usize; 2],
    /// The neighbours with changes that have not been looked at, one bit each in the order of [`RING`]; bit 8 is the tile itself.
    pub(crate) changed: u16,
    /// The one of them with the least change.
    pub(crate) first: u8,
    /// [`Limits::slack`] of each neighbour as far as it is known.
    pub(crate) slacks: [f32; 8],
    /// Whether the tile is its own neighbour along x and along y, as in a periodic direction one tile wide.
    pub(crate) is_ring: [bool; 2],
}

/// What solving a tile brought, besides the values in the [`Workspace`].
#[derive(Clone, Copy, Debug)]
pub(crate) struct Solved {
    /// Whether any value changed.
    pub(crate) is_changed: bool,
    /// For each neighbour, in the order of [`RING`], the least changed value that could improve it; infinite if none.
    pub(crate) changes: [f32; 8],
    /// The least value of the tile if it does not stand still yet; infinite if it does.
    pub(crate) unconverged: f32,
    /// Of the nodes that were looked at.
    pub(crate) limits: Limits,
    pub(crate) sweeps: u32,
}

/// Sweeps a tile until it stands still: away from the least change and back, then across and back.
pub(crate) fn solve(workspace: &mut Workspace, problem: &Problem<'_>) -> Solved {
    let &Problem { ref tile, rule, size, changed, first, slacks, is_ring } = problem;
    workspace.begin();
    let (dx, dy) = RING.get(usize::from(first)).copied().unwrap_or_default();
    let mut descending = [dy > 0, dx > 0];
    let mut by_columns = dx != 0 && dy == 0;
    // Rows and columns owed to changes outside, and those owed to changes inside, which either pays off.
    let mut outside = lines_beside(changed, size);
    let mut inside = [0; 2];
    let mut is_changed = false;
    let mut sweeps = 0;
    while sweeps < MAX_SWEEPS && (outside, inside) != ([0; 2], [0; 2]) {
        let side = usize::from(by_columns);
        let dirty = outside[side] | inside[side];
        if dirty != 0 {
            inside = workspace.sweep(tile, rule, by_columns, descending[side], dirty);
            outside[side] = 0;
            sweeps += 1;
            is_changed |= inside != [0; 2];
            descending[side] = !descending[side];
        }
        by_columns ^= dirty == 0 || outside[1 - side] != 0 || sweeps.is_multiple_of(2);
    }
    let converged = (outside, inside) == ([0; 2], [0; 2]);
    let limits = workspace.limits.of_all();
    let nothing = Solved {
        is_changed,
        changes: [f32::INFINITY; 8],
        unconverged: f32::INFINITY,
        limits,
        sweeps,
    };
    if !is_changed {
        return nothing;
    }
    workspace.transpose(false);
    let Workspace { values, before, .. } = &*workspace;
    let slacks = with_own(slacks, is_ring, limits.slack);
    let changes = changes::for_neighbours(before, values, size, slacks);
    let unconverged = if converged { f32::INFINITY } else { least_of(values) };
    Solved { changes, unconverged, ..nothing }
}

/// The slacks of the neighbours, where the tile itself is one with what was found of it now.
fn with_own(mut slacks: [f32; 8], is_ring: [bool; 2], own: f32) -> [f32; 8] {
    for (slack, (dx, dy)) in slacks.iter_mut().zip(RING) {
        if (dx == 0 || is_ring[0]) && (dy == 0 || is_ring[1]) {
            *slack = slack.max(own);
        }
    }
    slacks
}

/// The least value of a tile.
fn least_of(values: &Block) -> f32 {
    let nodes = values[1..=SIDE].iter().flat_map(|line| &line[1..=SIDE]);
    nodes.fold(f32::INFINITY, |least, &value| least.min(value))
}

/// What the update needs of `D`, by rows or by columns of a tile, made line by line when first needed.
#[derive(Debug)]
struct Prepared {
    lines: [Coefficients; SIDE],
    /// What to add to each neighbour in the order of [`RING`], if the tile lies in a [`Cone`].
    shifts: [[[f32; SIDE]; 8]; SIDE],
    ready: Lines,
}

impl Default for Prepared {
    fn default() -> Self {
        Self { lines: [Coefficients::CLOSED; SIDE], shifts: [[[0.0; SIDE]; 8]; SIDE], ready: 0 }
    }
}

/// Where a tile is solved; made once for many.
///
/// A sweep updates a whole row (or column) at a time, 16 nodes side by side, and carries changes across the tile in the
/// directions within 45° of its own. Lines none of whose neighbours changed are left out.
#[derive(Debug)]
pub(crate) struct Workspace {
    /// Transposed while sweeps go by columns.
    values: Block,
    by_columns: bool,
    /// The values before.
    before: Block,
    prepared: [Prepared; 2],
    limits: LaneLimits,
}

impl Default for Workspace {
    fn default() -> Self {
        let unreached = [[UNREACHED; BLOCK]; BLOCK];
        Self {
            values: unreached,
            by_columns: false,
            before: unreached,
            prepared: Default::default(),
            limits: LaneLimits::default(),
        }
    }
}

impl Workspace {
    /// The values of the tile: to be filled before it is solved, to be read afterwards.
    pub(crate) fn values(&mut self) -> &mut Block {
        self.transpose(false);
        &mut self.values
    }

    fn begin(&mut self) {
        self.transpose(false);
        self.before = self.values;
        self.prepared.iter_mut().for_each(|side| side.ready = 0);
        self.limits = LaneLimits::default();
    }

    fn transpose(&mut self, by_columns: bool) {
        if self.by_columns != by_columns {
            self.by_columns = by_columns;
            mirror_block(&mut self.values);
        }
    }

    /// One Gauss–Seidel sweep by `rule` over the rows (or columns) in `dirty`, from the first to the last or the other way
    /// (`descending`), taking in those that become dirty ahead of it. A change below `tolerance` of a node's shortest step does
    /// not count.
    ///
    /// Returns the rows and the columns next to which something changed: doing either of them again does all.
    fn sweep(
        &mut self,
        tile: &Tile<'_>,
        rule: Rule,
        by_columns: bool,
        descending: bool,
        dirty: Lines,
    ) -> [Lines; 2] {
        self.transpose(by_columns);
        let prepared = &mut self.prepared[usize::from(by_columns)];
        let how = How { by_columns, descending };
        let mut changed = [0; SIDE];
        let sweep = match (rule, tile.cone.is_some()) {
            (Rule::Lower, false) => sweep,
            (Rule::Lower, true) => sweep_in_cone,
            (Rule::Forget, false) => forget,
            (Rule::Forget, true) => forget_in_cone,
        };
        let along =
            sweep(&mut self.values, prepared, tile, how, dirty, &mut changed, &mut self.limits);
        let across =
            (0..SIDE).fold(0, |set, i| if changed[i] == 0 { set } else { set | around(i) });
        if by_columns { [across, along] } else { [along, across] }
    }
}

/// How to sweep.
#[derive(Clone, Copy, Debug)]
pub(crate) struct How {
    pub(crate) by_columns: bool,
    pub(crate) descending: bool,
}

/// A line and the ones beside it.
#[inline(always)]
pub(crate) fn around(line: usize) -> Lines {
    ((0b111 << line) >> 1) & ALL
}

/// One triangle: the value through the segment from axis neighbour `a` to diagonal neighbour `b`; where the least over
/// the segment is at an end, not below that.
#[inline(always)]
pub(crate) fn triangle(a: f32, b: f32, lo: f32, hi: f32, [i, e, beta]: [f32; 3]) -> f32 {
    let d = greatest(least(b - a, hi), lo);
    let root = i - e * (d * d);
    a + (beta * d + greatest(root, 0.0).sqrt())
}

/// See [`Workspace::sweep`]. No fused multiply-add, so every instruction set gives the same bits.
/// One function for each rule, in and out of a cone: one that chooses inside was 2 to 4 % slower.
#[multiversion(targets(
    "x86_64+avx512f+avx512bw+avx512cd+avx512dq+avx512vl",
    "x86_64+avx2",
    "x86_64+sse4.1",
))]
fn sweep(
    values: &mut Block,
    prepared: &mut Prepared,
    tile: &Tile<'_>,
    how: How,
    dirty: Lines,
    changed: &mut [u32; SIDE],
    limits: &mut LaneLimits,
) -> Lines {
    sweep_lines::<false, false>(values, prepared, tile, how, dirty, changed, limits)
}

/// The same in a tile that lies in a [`Cone`].
#[multiversion(targets(
    "x86_64+avx512f+avx512bw+avx512cd+avx512dq+avx512vl",
    "x86_64+avx2",
    "x86_64+sse4.1",
))]
fn sweep_in_cone(
    values: &mut Block,
    prepared: &mut Prepared,
    tile: &Tile<'_>,
    how: How,
    dirty: Lines,
    changed: &mut [u32; SIDE],
    limits: &mut LaneLimits,
) -> Lines {
    sweep_lines::<true, false>(values, prepared, tile, how, dirty, changed, limits)
}

/// [`Rule::Forget`].
#[multiversion(targets(
    "x86_64+avx512f+avx512bw+avx512cd+avx512dq+avx512vl",
    "x86_64+avx2",
    "x86_64+sse4.1",
))]
fn forget(
    values: &mut Block,
    prepared: &mut Prepared,
    tile: &Tile<'_>,
    how: How,
    dirty: Lines,
    changed: &mut [u32; SIDE],
    limits: &mut LaneLimits,
) -> Lines {
    sweep_lines::<false, true>(values, prepared, tile, how, dirty, changed, limits)
}

/// The same in a tile that lies in a [`Cone`].
#[multiversion(targets(
    "x86_64+avx512f+avx512bw+avx512cd+avx512dq+avx512vl",
    "x86_64+avx2",
    "x86_64+sse4.1",
))]
fn forget_in_cone(
    values: &mut Block,
    prepared: &mut Prepared,
    tile: &Tile<'_>,
    how: How,
    dirty: Lines,
    changed: &mut [u32; SIDE],
    limits: &mut LaneLimits,
) -> Lines {
    sweep_lines::<true, true>(values, prepared, tile, how, dirty, changed, limits)
}

#[inline(always)]
fn sweep_lines<const IN_CONE: bool, const FORGET: bool>(
    values: &mut Block,
    prepared: &mut Prepared,
    tile: &Tile<'_>,
    how: How,
    dirty: Lines,
    changed: &mut [u32; SIDE],
    limits: &mut LaneLimits,
) -> Lines {
    let mut dirty = dirty;
    for step in 0..SIDE {
        let row = if how.descending { SIDE - 1 - step } else { step };
        if dirty & 1 << row == 0 {
            continue;
        }
        dirty &= !(1 << row);
        let k = &mut prepared.lines[row];
        if prepared.ready & 1 << row == 0 {
            prepared.ready |= 1 << row;
            prepare(tile, row, how, k, limits);
            if IN_CONE {
                prepare_shifts(tile, row, how, &mut prepared.shifts[row], limits);
            }
        }
        let (above, here, below) = (&values[row], &values[row + 1], &values[row + 2]);
        let (old, east, west) = (lanes(here, 1), lanes(here, 2), lanes(here, 0));
        let (south, north) = (lanes(below, 1), lanes(above, 1));
        let (south_east, north_west) = (lanes(below, 2), lanes(above, 0));
        let (north_east, south_west) = (lanes(above, 2), lanes(below, 0));
        let shifts = &prepared.shifts[row];
        let mut new = [0f32; SIDE];
        let mut any = 0;
        for i in 0..SIDE {
            let (mut e, mut w, mut s, mut n) = (east[i], west[i], south[i], north[i]);
            let (mut se, mut nw) = (pass(south_east[i], s, e), pass(north_west[i], n, w));
            let (mut ne, mut sw) = (pass(north_east[i], n, e), pass(south_west[i], s, w));
            if IN_CONE {
                (e, se, s, sw) =
                    (e + shifts[0][i], se + shifts[1][i], s + shifts[2][i], sw + shifts[3][i]);
                (w, nw, n, ne) =
                    (w + shifts[4][i], nw + shifts[5][i], n + shifts[6][i], ne + shifts[7][i]);
            }
            let edges = least(
                least(least(e, w) + k.east[i], least(s, n) + k.south[i]),
                least(least(se, nw) + k.rising[i], least(ne, sw) + k.falling[i]),
            );
            let x = [k.ix[i], k.ex[i], k.bx[i]];
            let y = [k.iy[i], k.ey[i], k.by[i]];
            let across_x = [k.ix[i], k.ex[i], -k.bx[i]];
            let across_y = [k.iy[i], k.ey[i], -k.by[i]];
            let (hx, hy) = (k.hx[i], k.hy[i]);
            let rising = least(
                least(triangle(e, se, k.rx[i], hx, x), triangle(w, nw, k.rx[i], hx, x)),
                least(triangle(s, se, k.ry[i], hy, y), triangle(n, nw, k.ry[i], hy, y)),
            );
            let falling = least(
                least(
                    triangle(e, ne, k.fx[i], -hx, across_x),
                    triangle(w, sw, k.fx[i], -hx, across_x),
                ),
                least(
                    triangle(s, sw, k.fy[i], -hy, across_y),
                    triangle(n, ne, k.fy[i], -hy, across_y),
                ),
            );
            let u = least(least(rising, falling), edges);
            let news;
            if FORGET {
                let margin = ROUNDING * old[i];
                // No step is shorter than √(min(1/xx, 1/yy)/2). A margin that is not far below lets nodes support each other.
                let supports =
                    (u <= old[i] + margin) & (margin * margin < 0.125 * least(k.ix[i], k.iy[i]));
                // Values of the start hold by themselves.
                news = !supports & (old[i] < least(k.ceiling[i], UNREACHED));
                new[i] = choose(news, UNREACHED, old[i]);
            } else {
                let floor = ROUNDING * u;
                let significant = greatest(k.tolerance[i], floor);
                news = (old[i] - u > significant) & (u < k.ceiling[i]);
                new[i] = choose(u < least(old[i], k.ceiling[i]), u, old[i]);
            }
            changed[i] |= u32::from(news);
            any |= u32::from(news);
        }
        values[row + 1][1..=SIDE].copy_from_slice(&new);
        if any != 0 {
            dirty |= around(row);
        }
    }
    dirty
}
