//! What the shape of a region is, in four numbers.
//!
//! The curvature tensor `C` of the surface, as a tensor in space, varies over a region; how it varies is what region
//! and region are compared by. At every node the four differences `v = (l1⁺, l1⁻, l2⁺, l2⁻)` between `C` there and at four
//! neighbours are taken; the signature is the sorted eigenvalues of the covariance of `v` over the region
//! (Seong, Jeong, Cohen 2008, section 5.2).
//!
//! The paper's neighbours are those on the grid, so its numbers change with the sampling and when the grid is
//! turned. Ours belong to the surface, see [`Neighbours::Surface`].

use glam::DVec2;
use rayon::prelude::*;
use serde::Serialize;

use crate::metric::of_surface;
use crate::{Control, Error, ParametricSurface, Result, SurfaceJet, Sym2};

/// Eigenvalues of the covariance of the neighbour differences over a region, largest first, 0 or more.
///
/// They have no unit and are the same for a region and its copy that is moved, turned, mirrored, scaled or has other parameters.
/// All 0 where the curvature is the same everywhere, and for regions of one node.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Signature {
    /// `λ1 ≥ λ2 ≥ λ3 ≥ λ4`.
    pub eigenvalues: [f64; 4],
    /// The region's size `√area`, m: what the eigenvalues know nothing of.
    pub size: f64,
}

/// Where the neighbours of a node lie whose curvature tensors it is compared with.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Neighbours {
    /// On the surface at a distance of 1/16 of the region's size `√area`, both ways along the two orthogonal tangents in
    /// which `C` changes most and least; differences are divided by that distance.
    #[default]
    Surface,
    /// The next nodes of the grid, as in the paper; differences are divided by the region's size. Depends on the
    /// sampling and on how the grid lies.
    Grid,
}

impl Signature {
    /// How unlike two shapes are, 0 to 1: `Σ |σ_i − σ'_i| / Σ (σ_i + σ'_i)` with `σ = √λ` (Bray and Curtis 1957). Sums below 1e-3
    /// count as none: a surface that bends has some 1.
    #[must_use]
    pub fn distance(&self, other: &Self) -> f64 {
        const NONE: f64 = 1e-3;
        let pairs = || self.eigenvalues.iter().zip(other.eigenvalues);
        let apart: f64 = pairs().map(|(a, b)| (a.sqrt() - b.sqrt()).abs()).sum();
        let all: f64 = pairs().map(|(a, b)| a.sqrt() + b.sqrt()).sum();
        apart / (all + NONE)
    }

    /// Mean of [`distance`](Self::distance) and of `|a − a'| / (a + a')`, `a` the sizes.
    #[must_use]
    pub fn sized_distance(&self, other: &Self) -> f64 {
        let (a, b) = (self.size, other.size);
        let sizes = if a == b { 0.0 } else { (a - b).abs() / (a + b) };
        0.5 * (self.distance(other) + sizes)
    }
}

/// Signatures of regions `0, 1, …` of a surface, given the region of each node, row-major; nodes of no region are left out.
///
/// `δ` of the curvature tensor is twice the root-mean-square curvature of the region itself: what lies around it has no
/// say. Neighbours outside the region are missing: where one of two opposite ones is, the other stands for both.
///
/// # Cost
/// Some 0.4 µs of one core per node, and 48 bytes; on NURBS twice as long.
///
/// # Errors
/// [`Error::Usage`] if the labels do not fit the surface; [`Error::Cancelled`].
pub fn signatures(
    surface: &dyn ParametricSurface,
    labels: &[Option<u32>],
    neighbours: Neighbours,
    control: &Control,
) -> Result<Vec<Signature>> {
    let (cols, rows) = (surface.cols(), surface.rows());
    let nodes = cols * rows;
    if labels.len() != nodes {
        return Err(Error::usage(format!("{} labels for {nodes} nodes", labels.len())));
    }
    let regions = labels.iter().flatten().max().map_or(0, |&last| last as usize + 1);
    if regions > nodes {
        return Err(Error::usage(format!("label {} is larger than there are nodes", regions - 1)));
    }
    let periodic = surface.periodic();
    let over = Over { surface, cols, rows, periodic, labels, regions };
    let sizes: Vec<_> = over.sums(control, |sum: &mut Extent, _, jet, _| sum.add(jet))?;
    let sizes: Vec<_> = sizes.iter().map(Extent::size).collect();
    let tensors = over.tensors(&sizes, control)?;
    let sums = over.sums(control, |sum: &mut Moments, node, jet, region| {
        let place = Place { over: &over, tensors: &tensors, node, region };
        let size = sizes[region as usize];
        match neighbours {
            Neighbours::Surface => {
                if let Some([most, least]) = place.along_surface(jet, size.side * STEP) {
                    sum.add(jet.area(), &Moments::of_pairs(most, least));
                }
            }
            Neighbours::Grid => {
                if let Some(v) = place.along_grid(size.side) {
                    sum.add(jet.area(), &Moments::of(v));
                }
            }
        }
    })?;
    let signature = |(sum, size): (&Moments, &Size)| Signature {
        eigenvalues: eigenvalues(sum.covariance()),
        size: size.side,
    };
    Ok(sums.iter().zip(&sizes).map(signature).collect())
}

/// Distance of the neighbours on the surface as a share of the region's size. Finite, or opposite neighbours would not
/// differ and two of the eigenvalues be 0.
const STEP: f64 = 1.0 / 16.0;

/// `δ` as a share of the root-mean-square curvature of the region. That of the metric, 0.1, makes peaks of `C` along the lines
/// where a curvature changes its sign, which few grids resolve. Of 54 parts of seven shapes, each sampled two to six
/// ways, so many have one of the same part next to them: 39 with 0.1, 48 with 0.5, 51 with 1, 54 with 2, 51 with 4.
const DELTA_SHARE: f64 = 2.0;

/// A symmetric tensor in space as `xx, yy, zz, √2 yz, √2 xz, √2 xy`: the length of the vector is the Frobenius norm.
type Tensor = [f64; 6];

fn distance(a: &Tensor, b: &Tensor) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt()
}

/// A surface cut into regions.
struct Over<'a> {
    surface: &'a dyn ParametricSurface,
    cols: usize,
    rows: usize,
    periodic: [bool; 2],
    labels: &'a [Option<u32>],
    regions: usize,
}

/// What is added up over the nodes of a region.
trait Sum: Clone + Default + Send {
    fn merge(&mut self, other: &Self);
}

impl Over<'_> {
    /// The sum of each region over its nodes: `add(sum, node, jet, region)`. Added in the order of the rows, so that the
    /// number of threads changes nothing.
    fn sums<T: Sum>(
        &self,
        control: &Control,
        add: impl Fn(&mut T, [usize; 2], &SurfaceJet, u32) + Sync,
    ) -> Result<Vec<T>> {
        let of_row = |row: usize| {
            let mut sums: Vec<(u32, T)> = Vec::new();
            if control.cancel.is_cancelled() {
                return sums;
            }
            let labels = &self.labels[row * self.cols..][..self.cols];
            for (col, (jet, label)) in
                self.surface.row_space_jets(row).iter().zip(labels).enumerate()
            {
                let Some(region) = *label else { continue };
                // Neighbours along a row are mostly of one region.
                if sums.last().is_none_or(|(last, _)| *last != region) {
                    sums.push((region, T::default()));
                }
                if let Some((_, sum)) = sums.last_mut()
                    && jet.is_regular()
                {
                    add(sum, [col, row], jet, region);
                }
            }
            sums
        };
        let rows: Vec<_> = (0..self.rows).into_par_iter().map(of_row).collect();
        control.check()?;
        let mut sums = vec![T::default(); self.regions];
        for (region, sum) in rows.iter().flatten() {
            sums[*region as usize].merge(sum);
        }
        Ok(sums)
    }

    /// The curvature tensor at all nodes, with the `δ` of their region; not finite at nodes of no region and where the
    /// surface is degenerate.
    fn tensors(&self, sizes: &[Size], control: &Control) -> Result<Vec<Tensor>> {
        let cols = self.cols.max(1);
        let mut tensors = vec![[f64::NAN; 6]; self.labels.len()];
        let rows = tensors.par_chunks_mut(cols).zip(self.labels.par_chunks(cols));
        rows.enumerate().for_each(|(row, (tensors, labels))| {
            if control.cancel.is_cancelled() {
                return;
            }
            for ((tensor, jet), label) in
                tensors.iter_mut().zip(self.surface.row_space_jets(row)).zip(labels)
            {
                if let Some(region) = *label {
                    *tensor = curvature_tensor(&jet, sizes[region as usize].delta);
                }
            }
        });
        control.check()?;
        Ok(tensors)
    }

    /// The node at a place beside the grid or in it.
    fn node(&self, col: isize, row: isize) -> Option<usize> {
        let within = |at: isize, count: usize, periodic: bool| match usize::try_from(at) {
            Ok(at) if at < count => Some(at),
            _ => periodic.then(|| at.rem_euclid(count as isize) as usize),
        };
        let [around, about] = self.periodic;
        Some(within(row, self.rows, about)? * self.cols + within(col, self.cols, around)?)
    }

    /// The corners of the cell that begins at a place, if it lies in the grid and is not over a seam.
    fn cell(&self, col: isize, row: isize) -> Option<[usize; 4]> {
        let (col, row) = (usize::try_from(col).ok()?, usize::try_from(row).ok()?);
        let first = row * self.cols + col;
        (col + 1 < self.cols && row + 1 < self.rows)
            .then(|| [first, first + 1, first + self.cols, first + self.cols + 1])
    }
}

/// A node and what lies around it in its region.
struct Place<'a> {
    over: &'a Over<'a>,
    tensors: &'a [Tensor],
    node: [usize; 2],
    region: u32,
}

impl Place<'_> {
    /// `C` at the node `(col, row)` steps away.
    #[inline]
    fn tensor(&self, col: isize, row: isize) -> Option<&Tensor> {
        let node = self.over.node(self.node[0] as isize + col, self.node[1] as isize + row)?;
        (self.over.labels[node] == Some(self.region)).then(|| &self.tensors[node])
    }

    /// `C` at `by` grid steps away, bilinear between the nodes; `None` unless they all belong to the region.
    fn sample(&self, by: DVec2) -> Option<Tensor> {
        // Beside a pole a short way may go round it many times.
        const FAR: f64 = 1e9;
        let is_near = by.is_finite() && by.abs().max_element() < FAR;
        if !is_near {
            return None;
        }
        let low = by.floor();
        let DVec2 { x: u, y: v } = by - low;
        let (col, row) = (low.x as isize, low.y as isize);
        let weights = [(1.0 - u) * (1.0 - v), u * (1.0 - v), (1.0 - u) * v, u * v];
        let mut sum = [0.0; 6];
        let mut add = |weight: f64, tensor: &Tensor| {
            sum.iter_mut().zip(tensor).for_each(|(sum, c)| *sum += weight * c);
        };
        let [here_col, here_row] = self.node.map(|at| at as isize);
        let is_inside = |&node: &usize| self.over.labels[node] == Some(self.region);
        match self.over.cell(here_col + col, here_row + row) {
            Some(corners) if u * v > 0.0 && corners.iter().all(is_inside) => {
                corners.iter().zip(weights).for_each(|(&i, weight)| add(weight, &self.tensors[i]));
            }
            // Beside a border or a seam one by one, and only those that count.
            _ => {
                for ((i, j), weight) in [(0, 0), (1, 0), (0, 1), (1, 1)].into_iter().zip(weights) {
                    if weight > 0.0 {
                        add(weight, self.tensor(col + i, row + j)?);
                    }
                }
            }
        }
        Some(sum)
    }

    /// The paper's differences along the lines of the grid, as shares of the region's size.
    fn along_grid(&self, side: f64) -> Option<[f64; 4]> {
        let here = self.tensor(0, 0)?;
        let l = |col, row| Some(distance(here, self.tensor(col, row)?) / side);
        let [a, b] = both(l(1, 0), l(-1, 0))?;
        let [c, d] = both(l(0, 1), l(0, -1))?;
        Some([a, b, c, d])
    }

    /// Differences to the neighbours at a distance of `step` both ways along the two tangents, per distance.
    fn along_surface(&self, jet: &SurfaceJet, step: f64) -> Option<[[f64; 2]; 2]> {
        let here = self.tensor(0, 0)?;
        let l = |to| Some(distance(here, &self.sample(to)?) / step);
        let pair = |way: DVec2| {
            let bend = geodesic_bend(jet, way) * (0.5 * step * step);
            both(l(way * step - bend), l(way * -step - bend))
        };
        let [most, least] = self.tangents(jet);
        Some([pair(most)?, pair(least)?])
    }

    /// The orthogonal unit tangents, in grid coordinates, along which `C` changes most and least: the eigenvectors of the
    /// form `v ↦ ‖∇_v C‖²`, which does not know of the grid.
    fn tangents(&self, jet: &SurfaceJet) -> [DVec2; 2] {
        let slope = |col: isize, row: isize| {
            let ends = [self.tensor(-col, -row), self.tensor(0, 0), self.tensor(col, row)];
            let (from, to, length) = match ends {
                [Some(from), _, Some(to)] => (from, to, 2.0),
                [None, Some(from), Some(to)] | [Some(from), Some(to), None] => (from, to, 1.0),
                _ => return [0.0; 6],
            };
            std::array::from_fn(|i| (to[i] - from[i]) / length)
        };
        let slopes: [Tensor; 2] = [slope(1, 0), slope(0, 1)];
        let frame = orthonormal_frame(jet);
        let along = frame.map(|e| -> Tensor {
            std::array::from_fn(|i| e.x * slopes[0][i] + e.y * slopes[1][i])
        });
        let dot = |a: &Tensor, b: &Tensor| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let [a, b] = &along;
        let axis = long_axis(Sym2::new(dot(a, a), dot(a, b), dot(b, b)));
        [frame[0] * axis.x + frame[1] * axis.y, frame[1] * axis.x - frame[0] * axis.y]
    }
}

/// Differences in opposite directions, one for both where the other is missing.
fn both(plus: Option<f64>, minus: Option<f64>) -> Option<[f64; 2]> {
    Some([plus.or(minus)?, minus.or(plus)?])
}

/// Unit eigenvector of the larger eigenvalue.
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

/// Two orthogonal unit tangents in grid coordinates.
fn orthonormal_frame(jet: &SurfaceJet) -> [DVec2; 2] {
    let g = jet.first_form();
    let root = g.xx.sqrt();
    [DVec2::new(1.0 / root, 0.0), DVec2::new(-g.xy, g.xx) / (root * g.det().sqrt())]
}

/// `Γ(v, v)`, `Γᵏ_ij = Gᵏˡ S_l·S_ij`: from `u` the geodesic with velocity `v` comes to `u + hv − h²/2 Γ(v, v)`.
fn geodesic_bend(jet: &SurfaceJet, v: DVec2) -> DVec2 {
    let [xx, xy, yy] = jet.second;
    let second = xx * (v.x * v.x) + xy * (2.0 * v.x * v.y) + yy * (v.y * v.y);
    jet.first_form().inverse().apply(DVec2::new(jet.first[0].dot(second), jet.first[1].dot(second)))
}

/// `C = Σ v_i v_iᵀ / (δ+|κ_i|) = J D Jᵀ` in space.
fn curvature_tensor(jet: &SurfaceJet, delta: f64) -> Tensor {
    let d = of_surface(jet, delta);
    let [a, b] = jet.first.map(|s| s.to_array());
    let entry = |i: usize, j: usize| {
        d.xx * a[i] * a[j] + d.xy * (a[i] * b[j] + b[i] * a[j]) + d.yy * b[i] * b[j]
    };
    let twice = |i, j| std::f64::consts::SQRT_2 * entry(i, j);
    [entry(0, 0), entry(1, 1), entry(2, 2), twice(1, 2), twice(0, 2), twice(0, 1)]
}

/// Area of a region and the integral of `(κ1² + κ2²)/2` over it.
#[derive(Clone, Default)]
struct Extent {
    area: f64,
    squared_curvature: f64,
}

/// What a region is measured by.
#[derive(Clone, Copy)]
struct Size {
    /// `√area`, m.
    side: f64,
    /// Offset of its curvature tensor, 1/m.
    delta: f64,
}

impl Extent {
    fn add(&mut self, jet: &SurfaceJet) {
        let ([mean, gaussian], area) = (jet.mean_and_gaussian(), jet.area());
        self.area += area;
        self.squared_curvature += area * (2.0 * mean * mean - gaussian);
    }

    fn size(&self) -> Size {
        let side = self.area.sqrt();
        let rms = (self.squared_curvature / self.area).sqrt();
        // As for a whole surface: curvature below this is rounding.
        let flat = 1e-8 / side;
        let delta = if rms > flat { DELTA_SHARE * rms } else { side.recip() };
        Size { side, delta }
    }
}

impl Sum for Extent {
    fn merge(&mut self, other: &Self) {
        self.area += other.area;
        self.squared_curvature += other.squared_curvature;
    }
}

/// Weighted sums of vectors and of their products.
#[derive(Clone, Default)]
struct Moments {
    weight: f64,
    first: [f64; 4],
    second: [[f64; 4]; 4],
}

impl Moments {
    /// Those of one vector.
    fn of(v: [f64; 4]) -> Self {
        Self { weight: 1.0, first: v, second: v.map(|a| v.map(|b| a * b)) }
    }

    /// The mean of those of `(a, b, c, d)`, `(b, a, c, d)`, `(a, b, d, c)` and `(b, a, d, c)`: which way along a tangent is plus is
    /// arbitrary.
    fn of_pairs([a, b]: [f64; 2], [c, d]: [f64; 2]) -> Self {
        let (x, y) = (0.5 * (a + b), 0.5 * (c + d));
        let (xx, yy) = (0.5 * (a * a + b * b), 0.5 * (c * c + d * d));
        let (ab, cd, xy) = (a * b, c * d, x * y);
        let second = [[xx, ab, xy, xy], [ab, xx, xy, xy], [xy, xy, yy, cd], [xy, xy, cd, yy]];
        Self { weight: 1.0, first: [x, x, y, y], second }
    }

    /// Adds others `weight` times, if they are finite.
    fn add(&mut self, weight: f64, other: &Self) {
        if !other.first.iter().all(|v| v.is_finite()) {
            return;
        }
        self.weight += weight * other.weight;
        for i in 0..4 {
            self.first[i] += weight * other.first[i];
            let sums = self.second[i].iter_mut().zip(other.second[i]);
            sums.for_each(|(sum, more)| *sum += weight * more);
        }
    }

    /// All 0 if nothing was added.
    fn covariance(&self) -> [[f64; 4]; 4] {
        let weight = if self.weight > 0.0 { self.weight } else { 1.0 };
        let mean = self.first.map(|sum| sum / weight);
        std::array::from_fn(|i| {
            std::array::from_fn(|j| self.second[i][j] / weight - mean[i] * mean[j])
        })
    }
}

impl Sum for Moments {
    fn merge(&mut self, other: &Self) {
        self.add(1.0, other);
    }
}

/// Eigenvalues of a positive semidefinite matrix, largest first, by Jacobi's rotations; what rounding made negative is 0.
fn eigenvalues(mut a: [[f64; 4]; 4]) -> [f64; 4] {
    /// They converge quadratically; six are enough for 4×4.
    const SWEEPS: usize = 8;
    for _ in 0..SWEEPS {
        for p in 0..4 {
            for q in p + 1..4 {
                if a[p][q] != 0.0 {
                    rotate(&mut a, p, q);
                }
            }
        }
    }
    let mut values: [f64; 4] = std::array::from_fn(|i| a[i][i].max(0.0));
    values.sort_by(|a, b| b.total_cmp(a));
    values
}

/// Turns the plane of axes `p` and `q` so that `a[p][q]` becomes 0 (Golub and Van Loan, section 8.5).
fn rotate(a: &mut [[f64; 4]; 4], p: usize, q: usize) {
    let tau = (a[q][q] - a[p][p]) / (2.0 * a[p][q]);
    let t = 1f64.copysign(tau) / (tau.abs() + tau.hypot(1.0));
    let c = t.hypot(1.0).recip();
    let s = t * c;
    for row in a.iter_mut() {
        (row[p], row[q]) = (c * row[p] - s * row[q], s * row[p] + c * row[q]);
    }
    let (x, y) = (a[p], a[q]);
    a[p] = std::array::from_fn(|k| c * x[k] - s * y[k]);
    a[q] = std::array::from_fn(|k| s * x[k] + c * y[k]);
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two bumps and a dent over the unit disc, size `scale`, seen through the parameters `x = φ(u)`.
    #[derive(Clone, Copy, Debug)]
    struct Bumps {
        nodes: usize,
        scale: f64,
        turn: f64,
        /// Of a quadratic term of `φ`: the lines of the grid bend and crowd.
        bend: f64,
        lift: f64,
    }

    impl Bumps {
        fn of(nodes: usize) -> Self {
            Self { nodes, scale: 1.0, turn: 0.0, bend: 0.0, lift: 1.0 }
        }

        /// `x` and its derivatives by grid coordinates; `x` runs beyond the unit disc on all sides.
        fn plan(&self, at: DVec2) -> [DVec2; 6] {
            let step = 3.0 / (self.nodes - 1) as f64;
            let turn = DVec2::from_angle(self.turn);
            let DVec2 { x: u, y: v } = at * step - 1.5;
            let b = self.bend;
            let (x, y) = (u + b * v * v + b * u * u, v - b * u * v);
            let first =
                [DVec2::new(1.0 + 2.0 * b * u, -b * v), DVec2::new(2.0 * b * v, 1.0 - b * u)];
            let second = [DVec2::new(2.0 * b, 0.0), DVec2::new(0.0, -b), DVec2::new(2.0 * b, 0.0)];
            [
                turn.rotate(DVec2::new(x, y)),
                turn.rotate(first[0]) * step,
                turn.rotate(first[1]) * step,
                turn.rotate(second[0]) * (step * step),
                turn.rotate(second[1]) * (step * step),
                turn.rotate(second[2]) * (step * step),
            ]
        }

        /// `z`, its gradient and its Hessian.
        fn height(&self, x: DVec2) -> (f64, DVec2, Sym2) {
            let mut sum = (0.0, DVec2::ZERO, Sym2::default());
            for (height, cx, cy, a, b) in
                [(0.5, 0.3, 0.2, 0.4, 0.6), (0.3, -0.4, 0.1, 0.5, 0.3), (-0.3, 0.0, -0.5, 0.4, 0.4)]
            {
                let d = x - DVec2::new(cx, cy);
                let k = DVec2::new(1.0 / (a * a), 1.0 / (b * b));
                let z = self.lift * height * (-0.5 * (k * d).dot(d)).exp();
                sum.0 += z;
                sum.1 += k * d * -z;
                sum.2 = sum.2 + (Sym2::outer(k * d) + Sym2::new(-k.x, 0.0, -k.y)) * z;
            }
            sum
        }

        /// The disc is region 0.
        fn labels(&self) -> Vec<Option<u32>> {
            let at = |i: usize| DVec2::new((i % self.nodes) as f64, (i / self.nodes) as f64);
            (0..self.nodes * self.nodes)
                .map(|i| (self.plan(at(i))[0].length() < 1.0).then_some(0))
                .collect()
        }

        fn signature(&self, neighbours: Neighbours) -> Signature {
            signatures(self, &self.labels(), neighbours, &Control::default()).unwrap()[0]
        }
    }

    impl ParametricSurface for Bumps {
        fn cols(&self) -> usize {
            self.nodes
        }

        fn rows(&self) -> usize {
            self.nodes
        }

        fn space_jet(&self, at: DVec2) -> SurfaceJet {
            let [x, x1, x2, x11, x12, x22] = self.plan(at);
            let (z, gradient, hessian) = self.height(x);
            let first = |a: DVec2| a.extend(gradient.dot(a)) * self.scale;
            let second = |a: DVec2, b: DVec2, ab: DVec2| {
                ab.extend(gradient.dot(ab) + a.dot(hessian.apply(b))) * self.scale
            };
            SurfaceJet {
                point: x.extend(z) * self.scale,
                first: [first(x1), first(x2)],
                second: [second(x1, x1, x11), second(x1, x2, x12), second(x2, x2, x22)],
            }
        }
    }

    /// The largest relative difference of two signatures.
    fn change(a: Signature, b: Signature) -> f64 {
        let pairs = a.eigenvalues.into_iter().zip(b.eigenvalues);
        pairs.map(|(a, b)| (a - b).abs() / b).fold(0.0, f64::max)
    }

    #[test]
    fn belongs_to_the_surface_and_not_to_the_grid() {
        let plain = Bumps::of(241);
        let signature = plain.signature(Neighbours::Surface);
        let others = [
            (Bumps { turn: 0.6, ..plain }, 0.05),
            (Bumps { bend: 0.12, ..plain }, 0.05),
            (Bumps { turn: 2.0, bend: 0.12, ..plain }, 0.05),
            (Bumps { scale: 250.0, ..plain }, 1e-9),
            (Bumps { nodes: 481, ..plain }, 0.1),
        ];
        for (other, most) in others {
            let change = change(other.signature(Neighbours::Surface), signature);
            assert!(change < most, "{change} {other:?}");
        }
        let finer = Bumps { nodes: 481, ..plain }.signature(Neighbours::Surface);
        assert!(finer.distance(&signature) < 0.02);
        // A bump half as high is another shape.
        let lower = Bumps { lift: 0.5, ..plain }.signature(Neighbours::Surface);
        assert!(lower.distance(&signature) > 0.2);
        // The paper's own neighbours: scale alone leaves them be.
        let literal = plain.signature(Neighbours::Grid);
        let grown = Bumps { scale: 250.0, ..plain }.signature(Neighbours::Grid);
        assert!(change(grown, literal) < 1e-9);
        let turned = Bumps { turn: 1.0, ..plain }.signature(Neighbours::Grid);
        assert!(change(turned, literal) > 0.1);
    }

    #[test]
    fn converges_with_the_grid() {
        let finest = Bumps::of(641).signature(Neighbours::Surface);
        let errors =
            [81, 161, 321].map(|n| finest.distance(&Bumps::of(n).signature(Neighbours::Surface)));
        assert!(errors[0] > errors[1] && errors[1] > errors[2] && errors[2] < 0.03, "{errors:?}");
    }

    /// A torus around the z axis with tube radius 1, closed both ways, or a sphere if the ring's radius is 0.
    struct Torus(f64);

    impl ParametricSurface for Torus {
        fn cols(&self) -> usize {
            64
        }

        fn rows(&self) -> usize {
            48
        }

        fn periodic(&self) -> [bool; 2] {
            [true; 2]
        }

        fn space_jet(&self, at: DVec2) -> SurfaceJet {
            use std::f64::consts::TAU;
            let rate = DVec2::new(TAU / 64.0, TAU / 48.0);
            let (around, along) = (DVec2::from_angle(at.x * rate.x), at.y * rate.y);
            let (radius, height) = (self.0 + along.cos(), along.sin());
            let ring = |r: f64, z: f64| (around * r).extend(z);
            SurfaceJet {
                point: ring(radius, height),
                first: [
                    (around.perp() * radius * rate.x).extend(0.0),
                    ring(-along.sin(), along.cos()) * rate.y,
                ],
                second: [
                    ring(-radius, 0.0) * (rate.x * rate.x),
                    (around.perp() * -along.sin() * rate.x * rate.y).extend(0.0),
                    ring(-along.cos(), -along.sin()) * (rate.y * rate.y),
                ],
            }
        }
    }

    fn of_all(
        surface: &impl ParametricSurface,
        label: impl Fn(usize) -> Option<u32>,
    ) -> Vec<Signature> {
        let labels: Vec<_> = (0..surface.cols() * surface.rows()).map(label).collect();
        signatures(surface, &labels, Neighbours::Surface, &Control::default()).unwrap()
    }

    #[test]
    fn halves_across_the_seam_of_a_ring_are_alike() {
        let torus = Torus(3.0);
        // Columns 0 to 31 and 32 to 63, and the same turned by 16 columns, across the seam.
        let whole = of_all(&torus, |i| Some(u32::from(i % 64 >= 32)));
        let turned = of_all(&torus, |i| Some(u32::from((i + 16) % 64 >= 32)));
        assert!(whole[0].eigenvalues[0] > 1e-4, "{whole:?}");
        for signature in [whole[1], turned[0], turned[1]] {
            assert!(signature.distance(&whole[0]) < 1e-6, "{signature:?} {whole:?}");
        }
    }

    #[test]
    fn nothing_varies_on_a_sphere_a_plane_or_a_node() {
        let sphere = of_all(&Torus(0.0), |i| (i / 64 < 8).then_some(0));
        assert!(sphere[0].eigenvalues[0] < 1e-3, "{sphere:?}");
        let plane = Bumps { lift: 0.0, ..Bumps::of(21) };
        assert_eq!(plane.signature(Neighbours::Surface).eigenvalues, [0.0; 4]);
        let node = of_all(&Torus(3.0), |i| (i == 700).then_some(0));
        assert_eq!(node[0].eigenvalues, [0.0; 4]);
        assert_eq!(node[0].distance(&sphere[0]).max(0.9), 0.9);
        // Region 1 has no node at all.
        assert_eq!(of_all(&Torus(3.0), |i| Some(2 * (i as u32 % 2)))[1], Signature::default());
        assert!(of_all(&Torus(3.0), |_| None).is_empty());
    }

    #[test]
    fn labels_that_do_not_fit_are_an_error() {
        let torus = Torus(3.0);
        for labels in [vec![Some(0); 5], vec![Some(u32::MAX); 64 * 48]] {
            assert!(signatures(&torus, &labels, Neighbours::Grid, &Control::default()).is_err());
        }
    }

    #[test]
    fn eigenvalues_are_those_of_a_known_matrix() {
        // Householder reflection of a diagonal matrix: I − 2vvᵀ, v = (1, 1, 1, 1)/2.
        let diagonal = [3.0, 0.5, 7.0, 0.0];
        let h = |i: usize, j: usize| if i == j { 0.5 } else { -0.5 };
        let a = std::array::from_fn(|i| {
            std::array::from_fn(|j| (0..4).map(|k| h(i, k) * diagonal[k] * h(k, j)).sum())
        });
        for (found, exact) in eigenvalues(a).into_iter().zip([7.0, 3.0, 0.5, 0.0]) {
            assert!((found - exact).abs() < 1e-13);
        }
    }
}
