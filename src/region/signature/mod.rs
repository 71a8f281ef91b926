//! The shape of a region in four numbers.
//!
//! The curvature tensor `C` of the surface, as a tensor in space, varies over a region; how it varies is what region
//! and region are compared by. At every node the four differences `v = (l1⁺, l1⁻, l2⁺, l2⁻)` between `C` there and at four
//! neighbours are taken; the signature is the sorted eigenvalues of the covariance of `v` over the region
//! (Seong, Jeong, Cohen 2008, section 5.2).
//!
//! The paper's neighbours are those on the grid, so its numbers change with the sampling and when the grid is
//! turned. Ours belong to the surface, see [`Neighbours::Surface`].

mod differences;
mod extent;
mod labelled_surface;
mod moments;
mod tensors;

use serde::Serialize;

use self::differences::{AlongSurface, along_grid};
use self::extent::{Extent, Extents, Size};
use self::labelled_surface::LabelledSurface;
use self::moments::{Moments, eigenvalues};
use self::tensors::Tensors;
use crate::control::Control;
use crate::error::{Error, Result};
use crate::linalg::simd;
use crate::surface::Surface;

/// Eigenvalues of the covariance of the neighbour differences over a region, largest first, 0 or more.
///
/// They have no unit and are the same for a region and its copy that is moved, turned, mirrored, scaled or has other parameters.
/// All 0 where the curvature is the same everywhere, in what is flat, bending by less than 1e-3 over its size, and for regions of one node.
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
    fn new(differences: &Moments, size: &Size) -> Self {
        let is_flat = size.is_flat;
        Self {
            eigenvalues: if is_flat { [0.0; 4] } else { eigenvalues(differences.covariance()) },
            size: size.side,
        }
    }

    /// Dissimilarity of two shapes, 0 (alike) to 1: `Σ |σ_i − σ'_i| / Σ (σ_i + σ'_i)` with `σ = √λ` (Bray and Curtis 1957). Sums below 1e-3
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
/// `δ` of the curvature tensor is twice the root-mean-square curvature of the region itself: what lies around it does not
/// matter. Neighbours outside the region are missing: where one of two opposite ones is, the other stands for both.
///
/// # Cost
/// Some 0.15 µs of one core per node, and 49 bytes; on NURBS 0.25 µs. `docs/matching.md` has measurements.
///
/// # Errors
/// [`Error::Argument`] if the labels do not fit the surface; [`Error::Cancelled`].
pub fn signatures(
    surface: &dyn Surface,
    labels: &[Option<u32>],
    neighbours: Neighbours,
    control: &Control,
) -> Result<Vec<Signature>> {
    let (cols, rows) = (surface.cols(), surface.rows());
    let nodes = cols * rows;
    if labels.len() != nodes {
        return Err(Error::argument(
            "the number of labels",
            labels.len(),
            format!("{nodes}, that of the nodes"),
        ));
    }
    let regions = labels.iter().flatten().max().map_or(0, |&last| last as usize + 1);
    if regions > nodes {
        return Err(Error::argument(
            "the largest label",
            regions - 1,
            format!("below the number of nodes, {nodes}"),
        ));
    }
    let labelled =
        LabelledSurface { surface, cols, rows, periodic: surface.periodic(), labels, regions };
    let extents =
        labelled.sums(control, |run, extents| simd::dispatch(Extents { run, extents }))?;
    let sizes: Vec<_> = extents.iter().map(Extent::size).collect();
    let tensors = Tensors::new(&labelled, &sizes, control)?;
    let sums = labelled.sums(control, |run, moments| match neighbours {
        Neighbours::Surface => {
            simd::dispatch(AlongSurface { tensors: &tensors, sizes: &sizes, run, moments });
        }
        Neighbours::Grid => along_grid(&tensors, &sizes, run, moments),
    })?;
    Ok(sums.iter().zip(&sizes).map(|(sum, size)| Signature::new(sum, size)).collect())
}

#[cfg(test)]
mod tests {
    use glam::DVec2;

    use super::*;
    use crate::linalg::Sym2;
    use crate::surface::in_space::InSpace;
    use crate::surface::{FitOptions, HeightSurface, Jet, SurfaceJet};
    use crate::synthetic::{Synthetic, SyntheticKind};
    use crate::terrain::Crs;

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
        fn phi(&self, at: DVec2) -> [DVec2; 6] {
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
                .map(|i| (self.phi(at(i))[0].length() < 1.0).then_some(0))
                .collect()
        }

        fn signature(&self, neighbours: Neighbours) -> Signature {
            signatures(self, &self.labels(), neighbours, &Control::default()).unwrap()[0]
        }
    }

    impl Surface for Bumps {
        fn cols(&self) -> usize {
            self.nodes
        }

        fn rows(&self) -> usize {
            self.nodes
        }

        fn jet(&self, at: DVec2) -> Jet {
            let [x, x1, x2, x11, x12, x22] = self.phi(at);
            let (z, gradient, hessian) = self.height(x);
            let first = |a: DVec2| a.extend(gradient.dot(a)) * self.scale;
            let second = |a: DVec2, b: DVec2, ab: DVec2| {
                ab.extend(gradient.dot(ab) + a.dot(hessian.apply(b))) * self.scale
            };
            Jet::Space(SurfaceJet {
                point: x.extend(z) * self.scale,
                first: [first(x1), first(x2)],
                second: [second(x1, x1, x11), second(x1, x2, x12), second(x2, x2, x22)],
            })
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

    impl Surface for Torus {
        fn cols(&self) -> usize {
            64
        }

        fn rows(&self) -> usize {
            48
        }

        fn periodic(&self) -> [bool; 2] {
            [true; 2]
        }

        fn jet(&self, at: DVec2) -> Jet {
            use std::f64::consts::TAU;
            let rate = DVec2::new(TAU / 64.0, TAU / 48.0);
            let (around, along) = (DVec2::from_angle(at.x * rate.x), at.y * rate.y);
            let (radius, height) = (self.0 + along.cos(), along.sin());
            let ring = |r: f64, z: f64| (around * r).extend(z);
            Jet::Space(SurfaceJet {
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
            })
        }
    }

    fn of_all(surface: &impl Surface, label: impl Fn(usize) -> Option<u32>) -> Vec<Signature> {
        let labels: Vec<_> = (0..surface.cols() * surface.rows()).map(label).collect();
        signatures(surface, &labels, Neighbours::Surface, &Control::default()).unwrap()
    }

    #[test]
    fn neither_threads_nor_blocks_of_heights_change_anything() {
        let range = Synthetic::new(SyntheticKind::Range, 75, 53, 30.0).unwrap();
        let terrain = range.terrain(Crs::none(), DVec2::ZERO).unwrap();
        let control = Control::default();
        let heights = HeightSurface::fit(&terrain, &FitOptions::default(), &control).unwrap();
        let label = |i: usize| {
            let (col, row) = (i % 75, i / 75);
            (col + row > 20).then(|| ((col + row / 3) / 40 + 2 * (row / 30)) as u32)
        };
        let with = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| of_all(&heights, label))
        };
        let one = with(1);
        assert!([2, 5].into_iter().all(|threads| with(threads) == one));
        for (block, single) in one.iter().zip(of_all(&InSpace::new(&heights), label)) {
            assert!(change(*block, single) < 1e-9, "{block:?} {single:?}");
        }
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
        let rounded = Bumps { lift: 1e-5, ..plane };
        assert_eq!(rounded.signature(Neighbours::Surface).eigenvalues, [0.0; 4]);
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
}
