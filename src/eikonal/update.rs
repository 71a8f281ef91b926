//! The heart: the best value of one node from its eight neighbours.
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
//! [`segment`] is that minimum over one segment in plain form; [`sweep`] is the closed form over all eight at
//! once, many nodes at a time.

#![allow(clippy::needless_range_loop, reason = "lanes of several arrays go together")]

use glam::DVec2;
use multiversion::multiversion;

use super::cone::Cone;
use super::field::{SIDE, TensorTile};
use super::mirror::mirror_block;
use super::source::Seeds;
use crate::linalg::Sym2;

/// Value of a node that no front has reached. Far above any distance, and its square still a finite `f32`.
pub(crate) const UNREACHED: f32 = 1e18;

/// The ring of neighbours, counter-clockwise in index coordinates, axis neighbours at even places.
pub(crate) const RING: [(i32, i32); 8] =
    [(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1)];

/// The least of `(1−θ) ga + θ gb + ‖(1−θ) a + θ b‖_M` over `0 ≤ θ ≤ 1`, and the `θ`.
///
/// With `w = b − a` the length is `√(ww φ² + c)` in `φ = θ + aw/ww`, a hyperbola; its slope `ww φ/√(ww φ² + c)`
/// meets `−d`, `d = gb − ga`, at `φ = −d √(c / (ww (ww − d²)))`. The sum is convex, so an end is best when
/// that lies outside.
pub(crate) fn segment(ga: f64, a: DVec2, gb: f64, b: DVec2, metric: Sym2) -> (f64, f64) {
    let w = b - a;
    let d = gb - ga;
    let ww = metric.form(w);
    let aw = a.dot(metric.apply(w));
    let c = (metric.form(a) - aw * aw / ww).max(0.0);
    let theta = if d * d < ww {
        let phi = -d * (c / (ww * (ww - d * d))).sqrt();
        (phi - aw / ww).clamp(0.0, 1.0)
    } else if d < 0.0 {
        1.0
    } else {
        0.0
    };
    (ga + theta * d + metric.norm(a.lerp(b, theta)), theta)
}

/// Side of a block: a tile and one node of each neighbour around it.
pub(super) const BLOCK: usize = SIDE + 2;

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
pub(super) struct Coefficients {
    /// `1/s`, `det D/s²` and `β/s` for triangles along x, then along y; `β` changes its sign in the other two quadrants.
    pub(super) ix: [f32; SIDE],
    pub(super) ex: [f32; SIDE],
    pub(super) bx: [f32; SIDE],
    pub(super) iy: [f32; SIDE],
    pub(super) ey: [f32; SIDE],
    pub(super) by: [f32; SIDE],
    /// `hi` along x and y; with the other sign in the other two quadrants.
    pub(super) hx: [f32; SIDE],
    pub(super) hy: [f32; SIDE],
    /// `lo` of the triangles with a diagonal (1,1) along x and y, then with (1,−1).
    pub(super) rx: [f32; SIDE],
    pub(super) ry: [f32; SIDE],
    pub(super) fx: [f32; SIDE],
    pub(super) fy: [f32; SIDE],
    /// Lengths of the steps (1,0), (0,1), (1,1), (1,−1).
    pub(super) east: [f32; SIDE],
    pub(super) south: [f32; SIDE],
    pub(super) rising: [f32; SIDE],
    pub(super) falling: [f32; SIDE],
    /// A change below this is no reason to go on.
    pub(super) tolerance: [f32; SIDE],
    /// The node is only lowered to below this: infinite but for nodes of the start.
    pub(super) ceiling: [f32; SIDE],
}

impl Coefficients {
    /// Nodes that are never updated: all steps are endless.
    pub(super) const CLOSED: Self = Self {
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

/// Values of a tile and of the nodes around it, row by row, each `(column, row)` from −1 to 16.
pub(crate) type Block = [[f32; BLOCK]; BLOCK];

/// A set of rows or of columns of a tile, one bit each.
pub(crate) type Lines = u32;

/// All rows of a tile.
pub(crate) const ALL: Lines = (1 << SIDE) - 1;

/// What the update needs of `D`, by rows or by columns of a tile, made line by line when first needed.
#[derive(Debug)]
pub(super) struct Prepared {
    pub(super) lines: [Coefficients; SIDE],
    /// What to add to each neighbour in the order of [`RING`], if the tile lies in a [`Cone`].
    pub(super) shifts: [[[f32; SIDE]; 8]; SIDE],
    ready: Lines,
}

impl Default for Prepared {
    fn default() -> Self {
        Self { lines: [Coefficients::CLOSED; SIDE], shifts: [[[0.0; SIDE]; 8]; SIDE], ready: 0 }
    }
}

/// A tile on the workbench.
///
/// A sweep updates a whole row (or column) at a time, 16 nodes side by side, and carries news across the tile in the
/// directions within 45° of its own. Lines none of whose neighbours changed are left out.
#[derive(Debug)]
pub(crate) struct Bench {
    /// Mirrored on the diagonal while sweeps go by columns.
    values: Block,
    by_columns: bool,
    prepared: [Prepared; 2],
    limits: LaneLimits,
}

impl Default for Bench {
    fn default() -> Self {
        Self {
            values: [[UNREACHED; BLOCK]; BLOCK],
            by_columns: false,
            prepared: Default::default(),
            limits: LaneLimits::default(),
        }
    }
}

/// What is known of the updated nodes of a tile.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Limits {
    /// By how much the value of a neighbour may exceed that of a node and still improve it. A node's least over a segment
    /// is above both ends unless the directions to them make an obtuse angle under `M`; then it may lie below
    /// one end `a` by up to `−aᵀMb/‖b‖`. A cone lowers the neighbours' values besides.
    pub(crate) slack: f32,
    /// The longest step of any node.
    pub(crate) longest_step: f32,
}

/// [`Limits`] of the nodes in each lane; their greatest at once would be a chain of comparisons, one after the other.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct LaneLimits {
    slack: [f32; SIDE],
    /// By how much a cone lowers a neighbour's value at most.
    shift: [f32; SIDE],
    longest_step: [f32; SIDE],
}

impl Bench {
    /// Room for the values of the next tile.
    pub(crate) fn clear(&mut self) -> &mut Block {
        self.by_columns = false;
        self.prepared.iter_mut().for_each(|side| side.ready = 0);
        self.limits = LaneLimits::default();
        &mut self.values
    }

    /// The values as they are now.
    pub(crate) fn values(&mut self) -> &Block {
        self.turn(false);
        &self.values
    }

    pub(crate) fn limits(&self) -> Limits {
        let LaneLimits { slack, shift, longest_step } = &self.limits;
        let all = |lanes: &[f32; SIDE]| lanes.iter().copied().fold(0.0, greatest);
        Limits { slack: all(slack) + all(shift), longest_step: all(longest_step) }
    }

    fn turn(&mut self, by_columns: bool) {
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
    pub(crate) fn sweep(
        &mut self,
        tile: &Tile<'_>,
        rule: Rule,
        by_columns: bool,
        descending: bool,
        dirty: Lines,
    ) -> [Lines; 2] {
        self.turn(by_columns);
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

/// What a sweep does to a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Rule {
    /// Lowers it to its best value over the ring.
    Lower,
    /// Makes it unreached if its ring no longer supports its value: if the best value over the ring is higher.
    Forget,
}

/// What a sweep reads.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Tile<'a> {
    pub(crate) tensors: &'a TensorTile,
    /// Cone that the tile lies in, and the tile's first node.
    pub(crate) cone: Option<(&'a Cone, DVec2)>,
    pub(crate) tolerance: f32,
    pub(crate) seeds: Option<&'a Seeds>,
}

/// How to sweep.
#[derive(Clone, Copy, Debug)]
pub(super) struct How {
    pub(super) by_columns: bool,
    pub(super) descending: bool,
}

/// A line and the ones beside it.
#[inline(always)]
pub(super) fn around(line: usize) -> Lines {
    ((0b111 << line) >> 1) & ALL
}

/// The tensors of one line of a tile: `xx`, `xy` and the determinant.
#[inline(always)]
pub(super) fn tensors(tile: &Tile<'_>, line: usize, how: How) -> [[f32; SIDE]; 3] {
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
pub(super) fn prepare(
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

#[inline(always)]
pub(super) fn choose(yes: bool, a: f32, b: f32) -> f32 {
    if yes { a } else { b }
}

/// The smaller of two; compiles to one instruction because NaN is not its business.
#[inline(always)]
pub(super) fn least(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

#[inline(always)]
pub(super) fn greatest(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// As many values as a tile has columns, from `shift` on.
#[inline(always)]
pub(super) fn lanes(line: &[f32], shift: usize) -> [f32; SIDE] {
    // Not `array::from_fn` or an iterator: what is not inlined here is not compiled for the wide registers.
    let mut lanes = [0.0; SIDE];
    lanes.copy_from_slice(&line[shift..shift + SIDE]);
    lanes
}

/// A diagonal neighbour, hidden where both nodes beside the step to it are closed: the step would leak through.
#[inline(always)]
pub(super) fn pass(diagonal: f32, a: f32, b: f32) -> f32 {
    if least(a, b) < f32::INFINITY { diagonal } else { f32::INFINITY }
}

/// One triangle: the value through the segment from axis neighbour `a` to diagonal neighbour `b`; where the least over
/// the segment is at an end, not below that.
#[inline(always)]
pub(super) fn triangle(a: f32, b: f32, lo: f32, hi: f32, [i, e, beta]: [f32; 3]) -> f32 {
    let d = greatest(least(b - a, hi), lo);
    let root = i - e * (d * d);
    a + (beta * d + greatest(root, 0.0).sqrt())
}

/// [`Cone::shift`] for the nodes of one line.
#[inline(always)]
pub(super) fn prepare_shifts(
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
pub(super) fn ceiling(seed: f32, shortest_step: f32) -> f32 {
    choose(seed < UNREACHED, seed - 0.5 * shortest_step, f32::INFINITY)
}

/// See [`Bench::sweep`]. No fused multiply-add, so every instruction set gives the same bits.
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

/// Four units in the last place of an `f32`: changes below are rounding.
pub(crate) const ROUNDING: f32 = 2.4e-7;
