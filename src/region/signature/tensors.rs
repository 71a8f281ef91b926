//! The curvature tensor in space at the nodes of a labelled surface.

#![allow(clippy::needless_range_loop, reason = "lanes of several arrays go together")]

use glam::DVec2;
use rayon::prelude::*;

use super::extent::Size;
use super::labelled_surface::{LabelledSurface, Run};
use crate::control::Control;
use crate::error::Result;
use crate::linalg::bilinear::{CORNERS, corner_weights};
use crate::linalg::simd::{self, Kernel};
use crate::metric::curvature_in_space;
use crate::surface::{BLOCK, Lanes, SurfaceJet};

/// A symmetric tensor in space as `xx, yy, zz, √2 yz, √2 xz, √2 xy`: the length of the vector is the Frobenius norm.
pub(super) type Tensor = [f64; 6];

/// The sum of six numbers in the order that pairs of registers favour.
#[inline(always)]
pub(super) fn sum(p: Tensor) -> f64 {
    ((p[0] + p[2]) + p[4]) + ((p[1] + p[3]) + p[5])
}

/// `‖a − b‖²`.
#[inline(always)]
pub(super) fn squared_distance(a: &Tensor, b: &Tensor) -> f64 {
    let mut squares = [0.0; 6];
    for k in 0..6 {
        let difference = a[k] - b[k];
        squares[k] = difference * difference;
    }
    sum(squares)
}

/// The curvature tensor at the nodes, with the `δ` of their region.
pub(super) struct Tensors<'a> {
    pub(super) labelled: &'a LabelledSurface<'a>,
    /// Not finite where the surface is degenerate, 0 at nodes of no region.
    of: Vec<Tensor>,
    /// Whether each node is the first corner of a cell inside a region.
    inner: Vec<bool>,
}

impl<'a> Tensors<'a> {
    pub(super) fn new(
        labelled: &'a LabelledSurface<'a>,
        sizes: &[Size],
        control: &Control,
    ) -> Result<Self> {
        let mut of = vec![[0.0; 6]; labelled.labels.len()];
        of.par_chunks_mut(labelled.cols.max(1) * BLOCK).enumerate().for_each(|(band, of)| {
            labelled.visit(band * BLOCK, control, |run| {
                let deltas = run.of_regions(|region| sizes[region].delta);
                let first = run.node[1] % BLOCK * labelled.cols + run.node[0];
                let tensors = &mut of[first..][..run.labels.len()];
                simd::dispatch(CurvatureTensors { run, deltas: &deltas, tensors });
            });
        });
        control.check()?;
        Ok(Self { labelled, of, inner: labelled.inner_cells() })
    }

    /// The tensor at a column and row in or next to the grid; `None` unless the node belongs to the region.
    pub(super) fn at(&self, col: isize, row: isize, region: u32) -> Option<&Tensor> {
        let node = self.labelled.node(col, row)?;
        (self.labelled.labels[node] == Some(region)).then(|| &self.of[node])
    }

    /// The tensors after and before a node of a region along columns and along rows, if all four neighbours belong to
    /// it and lie in the grid.
    #[inline(always)]
    pub(super) fn cross(&self, node: usize, region: u32) -> Option<[[&Tensor; 2]; 2]> {
        let cols = self.labelled.cols;
        let before = node.checked_sub(cols + 1)?;
        let is_inner =
            self.inner[node] && self.inner[before] && self.labelled.labels[before] == Some(region);
        is_inner.then(|| {
            let of = |node: usize| &self.of[node];
            [[of(node + 1), of(node - 1)], [of(node + cols), of(node - cols)]]
        })
    }

    /// The first corners of the cells that grid coordinates lie inside of, as indices in the row-major grid; [`MISSING`] on the lines of
    /// the grid and beyond it.
    #[inline(always)]
    pub(super) fn cells(&self, [cols, rows]: &[Lanes; 2]) -> Lanes {
        let (width, height) = (self.labelled.cols as f64, self.labelled.rows as f64);
        let mut cells = [MISSING; BLOCK];
        for i in 0..BLOCK {
            let (col, row) = (cols[i].floor(), rows[i].floor());
            let is_within = col >= 0.0 && col < width && row >= 0.0 && row < height;
            let is_inside = cols[i] > col && rows[i] > row;
            cells[i] = if is_within && is_inside { row * width + col } else { MISSING };
        }
        cells
    }

    /// `‖C(x) − C(y)‖²` for a node `x` and grid coordinates `y` in a [cell](Self::cells), bilinear between the nodes; [`MISSING`] unless
    /// they all belong to the region.
    #[inline(always)]
    pub(super) fn squared_distance(&self, node: usize, cell: f64, at: DVec2, region: u32) -> f64 {
        let (cell, is_cell) = (cell as usize, cell >= 0.0);
        if is_cell && self.inner[cell] && self.labelled.labels[cell] == Some(region) {
            let (a, b) = (&self.of[cell..][..2], &self.of[cell + self.labelled.cols..][..2]);
            let (here, [p, q, r, s]) = (&self.of[node], corner_weights(at - at.floor()));
            let mut squares = [0.0; 6];
            for k in 0..6 {
                let there = (p * a[0][k] + q * a[1][k]) + (r * b[0][k] + s * b[1][k]);
                squares[k] = (there - here[k]) * (there - here[k]);
            }
            return sum(squares);
        }
        self.sample(at, region).map_or(MISSING, |there| squared_distance(&there, &self.of[node]))
    }

    /// The tensor next to a border or a seam: nodes one by one, and only those that count.
    #[inline(never)]
    fn sample(&self, at: DVec2, region: u32) -> Option<Tensor> {
        // Beside a pole a short line may go round it many times.
        const FAR: f64 = 1e9;
        let low = at.floor();
        let is_near = low.is_finite() && low.abs().max_element() < FAR;
        if !is_near {
            return None;
        }
        let (col, row) = (low.x as isize, low.y as isize);
        let weights = corner_weights(at - low);
        let mut sum = [0.0; 6];
        for ((i, j), weight) in CORNERS.into_iter().zip(weights) {
            if weight > 0.0 {
                let tensor = self.at(col + i, row + j, region)?;
                sum.iter_mut().zip(tensor).for_each(|(sum, c)| *sum += weight * c);
            }
        }
        Some(sum)
    }
}

/// Stands for what is missing: the index of a cell, or the square of a difference.
pub(super) const MISSING: f64 = -1.0;

/// `C` at the nodes of a run with the `δ` of each.
struct CurvatureTensors<'a> {
    run: &'a Run<'a>,
    deltas: &'a Lanes,
    tensors: &'a mut [Tensor],
}

impl Kernel for CurvatureTensors<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { run, deltas, tensors } = self;
        let mut lanes = [[0.0; BLOCK]; 6];
        for i in 0..BLOCK {
            let tensor = curvature_tensor(&run.jets.get(i), deltas[i]);
            for k in 0..6 {
                lanes[k][i] = tensor[k];
            }
        }
        for (i, tensor) in tensors.iter_mut().enumerate().take(BLOCK) {
            for k in 0..6 {
                tensor[k] = lanes[k][i];
            }
        }
    }
}

/// `C = Σ v_i v_iᵀ / (δ+|κ_i|) = J D Jᵀ` in space.
#[inline(always)]
fn curvature_tensor(jet: &SurfaceJet, delta: f64) -> Tensor {
    let d = curvature_in_space(jet, delta);
    let [a, b] = jet.first.map(|s| s.to_array());
    let entry = |i: usize, j: usize| {
        d.xx * a[i] * a[j] + d.xy * (a[i] * b[j] + b[i] * a[j]) + d.yy * b[i] * b[j]
    };
    let twice = |i, j| std::f64::consts::SQRT_2 * entry(i, j);
    [entry(0, 0), entry(1, 1), entry(2, 2), twice(1, 2), twice(0, 2), twice(0, 1)]
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::surface::SpaceLanes;

    #[test]
    fn wide_registers_change_no_bit() {
        let jet = |i: usize| {
            let at = |k: usize| (1.7 * (7 * i + k) as f64).sin();
            let vector = |k: usize| DVec3::new(at(k), at(k + 1), at(k + 2));
            SurfaceJet {
                point: DVec3::ZERO,
                first: [vector(0), vector(3)],
                second: [vector(6), vector(9), vector(12)],
            }
        };
        let plain: Vec<SurfaceJet> = (0..BLOCK).map(jet).collect();
        let mut jets = SpaceLanes::default();
        jets.load_row(&plain);
        let run = Run { node: [0; 2], labels: &[], jets };
        let mut tensors = [[0.0; 6]; BLOCK];
        let deltas = &[0.3; BLOCK];
        simd::dispatch(CurvatureTensors { run: &run, deltas, tensors: &mut tensors });
        for (tensor, jet) in tensors.iter().zip(&plain) {
            assert_eq!(*tensor, curvature_tensor(jet, 0.3));
        }
    }
}
