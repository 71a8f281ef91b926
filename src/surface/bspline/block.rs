//! Jets of many nodes at once: a block of the grid, laid out for wide registers.
//!
//! A tensor-product spline is evaluated along one axis first. On a block that is cheap: the lines of
//! coefficients that bear on its rows are contracted along `x` once and serve all of its rows.

use std::ops::Range;

use glam::DVec2;

use super::basis::{Local, SUPPORT};
use super::fit::{Axis, Fit, dot};
use crate::linalg::simd::{self, Kernel};
use crate::surface::HeightJet;

/// Side of a block in nodes.
pub(crate) const BLOCK: usize = 16;

/// A number for each node of a row of a block.
pub(crate) type Lanes = [f64; BLOCK];

/// Jets at the nodes of a block, row by row: the fields of a [`HeightJet`] side by side.
///
/// Nodes beyond the last column or row of the grid mean nothing.
#[derive(Clone, Debug)]
pub(crate) struct HeightBlock {
    z: [Lanes; BLOCK],
    zx: [Lanes; BLOCK],
    zy: [Lanes; BLOCK],
    zxx: [Lanes; BLOCK],
    zxy: [Lanes; BLOCK],
    zyy: [Lanes; BLOCK],
    /// Room for the lines of coefficients that bear on the rows.
    lines: [Contracted; LINES],
}

impl Default for HeightBlock {
    fn default() -> Self {
        let zero = [[0.0; BLOCK]; BLOCK];
        let lines = [[[0.0; BLOCK]; 3]; LINES];
        Self { z: zero, zx: zero, zy: zero, zxx: zero, zxy: zero, zyy: zero, lines }
    }
}

impl HeightBlock {
    /// The jet in column `i` of row `row` of the block.
    #[inline(always)]
    pub(crate) fn jet(&self, row: usize, i: usize) -> HeightJet {
        HeightJet {
            z: self.z[row][i],
            zx: self.zx[row][i],
            zy: self.zy[row][i],
            zxx: self.zxx[row][i],
            zxy: self.zxy[row][i],
            zyy: self.zyy[row][i],
        }
    }

    /// Gives the node in column `i` of row `row` of the block a jet.
    pub(in crate::surface) fn set(&mut self, row: usize, i: usize, jet: &HeightJet) {
        let HeightJet { z, zx, zy, zxx, zxy, zyy } = *jet;
        self.z[row][i] = z;
        self.zx[row][i] = zx;
        self.zy[row][i] = zy;
        self.zxx[row][i] = zxx;
        self.zxy[row][i] = zxy;
        self.zyy[row][i] = zyy;
    }
}

/// Lines of coefficients that bear on the rows of a block: there are no more knots than nodes.
const LINES: usize = BLOCK + SUPPORT - 1;

/// The three contractions along `x` of a line of coefficients: those of the value, the first and the second derivative.
type Contracted = [Lanes; 3];

impl Fit {
    /// Jets at the nodes of the grid in columns `col ..` and rows `rows`, at most [`BLOCK`] of them; at the middles of the cells south-east of
    /// them if `centres`. `per_metre` are the nodes per metre along each row of such places and across it.
    pub(in crate::surface) fn jets(
        &self,
        per_metre: &[DVec2],
        col: usize,
        rows: Range<usize>,
        centres: bool,
        jets: &mut HeightBlock,
    ) {
        let (columns, uniform) = if centres {
            (&self.x.centres, &self.x.uniform_centres)
        } else {
            (&self.x.nodes, &self.x.uniform)
        };
        let nodes = &(if centres { &self.y.centres } else { &self.y.nodes })[rows.clone()];
        let (Some(top), Some(bottom)) = (nodes.first(), nodes.last()) else { return };
        let (width, support) = (self.x.basis.len(), self.y.basis.support());
        let lines = top.start * width..(bottom.start + support) * width;
        let lines = &self.coefficients[lines];
        if uniform.contains(&col) && uniform.contains(&(col + BLOCK - 1)) {
            let (node, contracted) = (&columns[col], &mut jets.lines);
            match self.x.basis.support() {
                4 => simd::dispatch(ContractUniform::<4> { lines, width, node, contracted }),
                _ => simd::dispatch(ContractUniform::<SUPPORT> { lines, width, node, contracted }),
            }
        } else {
            contract_any(lines, &self.x, &columns[col..], &mut jets.lines);
        }
        for (i, (node, per_metre)) in nodes.iter().zip(&per_metre[rows]).enumerate() {
            let lines = node.start - top.start..node.start - top.start + support;
            let per_metre = *per_metre;
            simd::dispatch(RowJets { lines, node, per_metre, row: i, jets });
        }
    }
}

/// Contracts lines of `width` coefficients at nodes that all have the weights of the first, `node`, each one
/// coefficient further on.
struct ContractUniform<'a, const N: usize> {
    lines: &'a [f64],
    width: usize,
    node: &'a Local,
    contracted: &'a mut [Contracted; LINES],
}

impl<const N: usize> Kernel for ContractUniform<'_, N> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { lines, width, node, contracted } = self;
        for (line, contracted) in lines.chunks_exact(width).zip(contracted) {
            let window = &line[node.start..node.start + BLOCK + N - 1];
            let mut sums = [[0.0; BLOCK]; 3];
            for k in 0..N {
                let coefficients = &window[k..k + BLOCK];
                for (order, sum) in sums.iter_mut().enumerate() {
                    let weight = node.weights[order][k];
                    for i in 0..BLOCK {
                        sum[i] += weight * coefficients[i];
                    }
                }
            }
            *contracted = sums;
        }
    }
}

/// Contracts lines of coefficients at any nodes.
fn contract_any(
    lines: &[f64],
    axis: &Axis,
    columns: &[Local],
    contracted: &mut [Contracted; LINES],
) {
    let support = axis.basis.support();
    for (line, contracted) in lines.chunks_exact(axis.basis.len()).zip(contracted) {
        for (i, node) in columns.iter().take(BLOCK).enumerate() {
            for (order, lanes) in contracted.iter_mut().enumerate() {
                lanes[i] = dot(&node.weights[order][..support], &line[node.start..]);
            }
        }
    }
}

/// Row `row` of a block, from the contracted `lines` that bear on it. Derivatives per node become those along
/// east and north: `∂x = ∂c/Δx`, `∂y = −∂r/Δy`.
struct RowJets<'a> {
    lines: Range<usize>,
    node: &'a Local,
    per_metre: DVec2,
    row: usize,
    jets: &'a mut HeightBlock,
}

impl Kernel for RowJets<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { lines, node, per_metre, row, jets } = self;
        let DVec2 { x, y } = per_metre;
        let [value, first, second, _] = &node.weights;
        let mut sums = [[0.0; BLOCK]; 6];
        for (k, [v, vx, vxx]) in jets.lines[lines].iter().enumerate() {
            accumulate(&mut sums[0], value[k], v);
            accumulate(&mut sums[1], value[k] * x, vx);
            accumulate(&mut sums[2], first[k] * -y, v);
            accumulate(&mut sums[3], value[k] * x * x, vxx);
            accumulate(&mut sums[4], first[k] * -y * x, vx);
            accumulate(&mut sums[5], second[k] * y * y, v);
        }
        [jets.z[row], jets.zx[row], jets.zy[row], jets.zxx[row], jets.zxy[row], jets.zyy[row]] =
            sums;
    }
}

#[inline(always)]
fn accumulate(sum: &mut Lanes, weight: f64, values: &Lanes) {
    for i in 0..BLOCK {
        sum[i] += weight * values[i];
    }
}

#[cfg(test)]
mod tests {
    use super::super::knots::FitPlan;
    use super::super::voids::fit_finite;
    use super::*;
    use crate::control::Control;
    use crate::grid::{GridFrame, Ground};

    #[test]
    fn wide_registers_change_no_bit() {
        let frame = GridFrame::new(53, 21, DVec2::ZERO, DVec2::ONE, Ground::METRES).unwrap();
        let heights: Vec<f64> = (0..frame.nodes()).map(|i| (i as f64).sin() * 1e3).collect();
        for degree in [3, 5] {
            let plan = FitPlan::every_node(&frame, degree);
            let fit = fit_finite(&frame, &heights, &plan, &Control::default()).unwrap();
            assert!(fit.x.uniform.contains(&16) && fit.x.uniform.contains(&31));
            let mut jets = HeightBlock::default();
            fit.jets(&[DVec2::ONE; 21], 16, 2..18, false, &mut jets);
            let count = 16 + fit.y.basis.support() - 1;
            let lines = &fit.coefficients[fit.y.nodes[2].start * 53..][..count * 53];
            let mut plain = HeightBlock::default().lines;
            contract_any(lines, &fit.x, &fit.x.nodes[16..], &mut plain);
            assert_eq!(jets.lines[..count], plain[..count]);
        }
    }
}
