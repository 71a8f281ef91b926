//! The differences between the curvature tensor at a node and at its four neighbours.

#![allow(clippy::needless_range_loop, reason = "lanes of several arrays go together")]

use glam::DVec2;

use super::extent::Size;
use super::labelled_surface::Run;
use super::moments::Moments;
use super::tensors::{MISSING, Tensor, Tensors, squared_distance, sum};
use crate::linalg::Sym2;
use crate::linalg::simd::Kernel;
use crate::surface::{BLOCK, Lanes, SurfaceJet};

/// Distance of the neighbours on the surface as a share of the region's size. Finite, or opposite neighbours would not
/// differ and two of the eigenvalues be 0.
const STEP: f64 = 1.0 / 16.0;

/// Moments of the differences to the neighbours on the surface: at a distance of [`STEP`] both ways along the two tangents in which
/// `C` changes most and least, per distance.
pub(super) struct AlongSurface<'a> {
    pub(super) tensors: &'a Tensors<'a>,
    pub(super) sizes: &'a [Size],
    pub(super) run: &'a Run<'a>,
    pub(super) moments: &'a mut [Moments; BLOCK],
}

impl Kernel for AlongSurface<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { tensors, sizes, run, moments } = self;
        let steps = run.of_regions(|region| STEP * sizes[region].side);
        let first = run.node[1] * tensors.labelled.cols + run.node[0];
        let changes = changes(tensors, run);
        let neighbours = neighbours(run, &steps, &changes);
        let cells = [0, 1, 2, 3].map(|k| tensors.cells(&neighbours[k]));
        let mut squares = [[MISSING; BLOCK]; 4];
        for (i, label) in run.labels.iter().enumerate() {
            let Some(region) = *label else { continue };
            for k in 0..4 {
                let at = DVec2::new(neighbours[k][0][i], neighbours[k][1][i]);
                squares[k][i] = tensors.squared_distance(first + i, cells[k][i], at, region);
            }
        }
        let (mut pairs, mut areas) = ([[0.0; BLOCK]; 4], [0.0; BLOCK]);
        for i in 0..BLOCK {
            for [k, across] in [[0, 1], [1, 0], [2, 3], [3, 2]] {
                // One for both where the other is missing; the root of none is no number.
                let square = if squares[k][i] < 0.0 { squares[across][i] } else { squares[k][i] };
                pairs[k][i] = square.sqrt() / steps[i];
            }
            let jet = run.jets.get(i);
            areas[i] = if jet.is_regular() { jet.area() } else { 0.0 };
        }
        for i in 0..BLOCK {
            let [a, b, c, d] = [0, 1, 2, 3].map(|k| pairs[k][i]);
            moments[i] = Moments::of_pairs([a, b], [c, d], areas[i]);
        }
    }
}

/// Moments of the differences to the neighbours on the grid, as shares of the region's size.
pub(super) fn along_grid(
    tensors: &Tensors<'_>,
    sizes: &[Size],
    run: &Run<'_>,
    moments: &mut [Moments; BLOCK],
) {
    for (i, label) in run.labels.iter().enumerate() {
        let of_region = |region| grid_moments(tensors, sizes, run, i, region);
        moments[i] = label.and_then(of_region).unwrap_or_default();
    }
}

/// Moments of the differences at node `i` of a run; `None` where all neighbours on a line are missing or the surface is degenerate.
fn grid_moments(
    tensors: &Tensors<'_>,
    sizes: &[Size],
    run: &Run<'_>,
    i: usize,
    region: u32,
) -> Option<Moments> {
    let side = sizes[region as usize].side;
    let node = [run.node[0] + i, run.node[1]];
    let [a, b] = grid_differences(tensors, node, [1, 0], side, region)?;
    let [c, d] = grid_differences(tensors, node, [0, 1], side, region)?;
    let jet = run.jets.get(i);
    jet.is_regular().then(|| Moments::of([a, b, c, d], jet.area()))
}

/// Differences to the two neighbours of a node on one line of the grid, as shares of `side`; one for both where the other is
/// missing.
fn grid_differences(
    tensors: &Tensors<'_>,
    node: [usize; 2],
    [x, y]: [isize; 2],
    side: f64,
    region: u32,
) -> Option<[f64; 2]> {
    let [col, row] = node.map(|at| at as isize);
    let here = tensors.at(col, row, region)?;
    let [after, before] = [1, -1].map(|by| {
        let there = tensors.at(col + by * x, row + by * y, region)?;
        Some(squared_distance(here, there).sqrt() / side)
    });
    Some([after.or(before)?, before.or(after)?])
}

/// How `C` changes around each node of a run: `⟨∂_i C, ∂_j C⟩` by grid coordinates. 0 along a line on which no neighbour is there.
#[inline(always)]
fn changes(tensors: &Tensors<'_>, run: &Run<'_>) -> [Lanes; 3] {
    let mut changes = [[0.0; BLOCK]; 3];
    let first = run.node[1] * tensors.labelled.cols + run.node[0];
    for (i, label) in run.labels.iter().enumerate() {
        let Some(region) = *label else { continue };
        let products = match tensors.cross(first + i, region) {
            Some([[east, west], [south, north]]) => {
                let [mut xx, mut xy, mut yy] = [[0.0; 6]; 3];
                for k in 0..6 {
                    let (x, y) = (0.5 * (east[k] - west[k]), 0.5 * (south[k] - north[k]));
                    (xx[k], xy[k], yy[k]) = (x * x, x * y, y * y);
                }
                [sum(xx), sum(xy), sum(yy)]
            }
            None => changes_at_border(tensors, [run.node[0] + i, run.node[1]], region),
        };
        changes.iter_mut().zip(products).for_each(|(change, product)| change[i] = product);
    }
    changes
}

/// The same next to a border or a seam: one-sided where a neighbour is missing.
#[inline(never)]
fn changes_at_border(tensors: &Tensors<'_>, node: [usize; 2], region: u32) -> [f64; 3] {
    let [x, y] = [[1, 0], [0, 1]].map(|line| derivative_at_border(tensors, node, line, region));
    [(x, x), (x, y), (y, y)].map(|(a, b)| sum(std::array::from_fn(|k| a[k] * b[k])))
}

/// `∂C` along a line of the grid from what neighbours there are; 0 if there is none.
fn derivative_at_border(
    tensors: &Tensors<'_>,
    node: [usize; 2],
    [x, y]: [isize; 2],
    region: u32,
) -> Tensor {
    let [col, row] = node.map(|at| at as isize);
    let (before, after, step) =
        match [-1, 0, 1].map(|by| tensors.at(col + by * x, row + by * y, region)) {
            [Some(before), _, Some(after)] => (before, after, 2.0),
            [None, Some(before), Some(after)] | [Some(before), Some(after), None] => {
                (before, after, 1.0)
            }
            _ => return [0.0; 6],
        };
    std::array::from_fn(|k| (after[k] - before[k]) / step)
}

/// Grid coordinates, columns and rows, of the four neighbours: along the geodesic `u + hv − h²/2 Γ(v, v)` for the unit tangents `v` in
/// which `C` changes most and least, both ways.
#[inline(always)]
fn neighbours(run: &Run<'_>, steps: &Lanes, changes: &[Lanes; 3]) -> [[Lanes; 2]; 4] {
    let mut neighbours = [[[0.0; BLOCK]; 2]; 4];
    for i in 0..BLOCK {
        let (jet, step) = (run.jets.get(i), steps[i]);
        let node = DVec2::new((run.node[0] + i) as f64, run.node[1] as f64);
        let directions =
            tangents(jet.first_form(), Sym2::new(changes[0][i], changes[1][i], changes[2][i]));
        for k in 0..2 {
            let v = directions[k];
            let (by, middle) = (v * step, node - christoffel(&jet, v) * (0.5 * step * step));
            let (plus, minus) = (middle + by, middle - by);
            [neighbours[2 * k][0][i], neighbours[2 * k][1][i]] = plus.to_array();
            [neighbours[2 * k + 1][0][i], neighbours[2 * k + 1][1][i]] = minus.to_array();
        }
    }
    neighbours
}

/// The orthogonal unit tangents, in grid coordinates, along which `C` changes most and least: the eigenvectors of the form
/// `v ↦ ‖∇_v C‖²` under the first form, which do not know of the grid.
#[inline(always)]
fn tangents(first_form: Sym2, changes: Sym2) -> [DVec2; 2] {
    let g = first_form;
    let root = g.xx.sqrt();
    let frame = [DVec2::new(1.0 / root, 0.0), DVec2::new(-g.xy, g.xx) / (root * g.det().sqrt())];
    let [along, across] = frame.map(|e| changes.apply(e));
    let axis = long_axis(Sym2::new(frame[0].dot(along), frame[1].dot(along), frame[1].dot(across)));
    [frame[0] * axis.x + frame[1] * axis.y, frame[1] * axis.x - frame[0] * axis.y]
}

/// Unit eigenvector of the larger eigenvalue.
#[inline(always)]
fn long_axis(form: Sym2) -> DVec2 {
    let half = 0.5 * (form.xx - form.yy);
    let radius = (half * half + form.xy * form.xy).sqrt();
    // Of the two expressions, the one that does not cancel.
    let axis = if half >= 0.0 {
        DVec2::new(half + radius, form.xy)
    } else {
        DVec2::new(form.xy, radius - half)
    };
    axis.normalize_or(DVec2::X)
}

/// `Γ(v, v)` of the Christoffel symbols `Γᵏ_ij = Gᵏˡ S_l·S_ij`.
#[inline(always)]
fn christoffel(jet: &SurfaceJet, v: DVec2) -> DVec2 {
    let [xx, xy, yy] = jet.second;
    let second = xx * (v.x * v.x) + xy * (2.0 * v.x * v.y) + yy * (v.y * v.y);
    jet.first_form().inverse().apply(DVec2::new(jet.first[0].dot(second), jet.first[1].dot(second)))
}
