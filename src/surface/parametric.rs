//! Surfaces in space over a grid of parameters.

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::{HeightJet, HeightSurface};
use crate::linalg::Sym2;

/// A smooth map `S` from grid coordinates into space.
///
/// The parameters are grid coordinates: `u = (u1, u2)` = (column, row), nodes at whole numbers, so that a node's
/// neighbours are one step away. A surface with other parameters is put on a grid by a linear map of them.
///
/// In a [periodic](Self::periodic) direction node `cols` (or `rows`) is node 0 again; in others the grid ends at
/// node `cols − 1`.
pub trait ParametricSurface: Sync {
    /// Nodes along the first parameter.
    fn cols(&self) -> usize;

    /// Nodes along the second parameter.
    fn rows(&self) -> usize;

    /// Whether columns, and whether rows, close to a ring.
    fn periodic(&self) -> [bool; 2] {
        [false; 2]
    }

    /// Whether the node is missing: the surface there is only a continuation.
    fn is_void(&self, col: usize, row: usize) -> bool {
        let _ = (col, row);
        false
    }

    /// `S` and its derivatives by the grid coordinates at `at`.
    fn space_jet(&self, at: DVec2) -> SurfaceJet;

    /// The surface as one of heights, if it is one: such are evaluated faster.
    #[doc(hidden)]
    fn as_heights(&self) -> Option<&HeightSurface> {
        None
    }

    /// Jets at all nodes of a row.
    fn row_space_jets(&self, row: usize) -> Vec<SurfaceJet> {
        (0..self.cols()).map(|col| self.space_jet(DVec2::new(col as f64, row as f64))).collect()
    }

    /// Area, m², and root mean square of the principal curvatures over it, `√(∫ (κ1² + κ2²)/2 dA / ∫ dA)` in 1/m, from the
    /// nodes by the trapezoidal rule.
    fn measures(&self) -> Measures {
        measured(self, |_, _| true)
    }
}

/// See [`ParametricSurface::measures`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measures {
    /// Area of the surface, m².
    pub area: f64,
    /// Root mean square of the principal curvatures, 1/m.
    pub rms_curvature: f64,
}

/// The measures from the nodes, `(column, row)`, that count.
pub(super) fn measured(
    surface: &(impl ParametricSurface + ?Sized),
    counts: impl Fn(usize, usize) -> bool + Sync,
) -> Measures {
    let nodes = [surface.cols(), surface.rows()];
    let share = |axis: usize, at: usize| {
        let is_end = at == 0 || at + 1 == nodes[axis];
        if is_end && !surface.periodic()[axis] { 0.5 } else { 1.0 }
    };
    let of_row = |row: usize| {
        let jets = surface.row_space_jets(row).into_iter().enumerate();
        let known = jets.filter(|(col, jet)| {
            jet.is_regular() && !surface.is_void(*col, row) && counts(*col, row)
        });
        known.fold([0.0; 2], |[area, square], (col, jet)| {
            let piece = share(0, col) * share(1, row) * jet.area();
            [area + piece, square + piece * jet.squared_curvature()]
        })
    };
    let rows: Vec<[f64; 2]> = (0..nodes[1]).into_par_iter().map(of_row).collect();
    // Added row by row, so that the sum does not depend on the number of threads.
    let [area, square] =
        rows.iter().fold([0.0; 2], |[a, s], [area, square]| [a + area, s + square]);
    let mean = if area > 0.0 { 0.5 * square / area } else { 0.0 };
    Measures { area, rms_curvature: mean.sqrt() }
}

/// A point of a surface and the derivatives there by the two parameters.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SurfaceJet {
    /// `S`, m.
    pub point: DVec3,
    /// `S_1` and `S_2`.
    pub first: [DVec3; 2],
    /// `S_11`, `S_12` and `S_22`.
    pub second: [DVec3; 3],
}

/// What is known from the first and the second fundamental form.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Forms {
    /// `G⁻¹`.
    pub(crate) inverse: Sym2,
    /// `B`.
    pub(crate) second: Sym2,
    /// `H`.
    pub(crate) mean: f64,
    /// `K`.
    pub(crate) gaussian: f64,
}

impl SurfaceJet {
    /// First fundamental form `G = JᵀJ`, `J = [S_1 S_2]`.
    #[must_use]
    #[inline(always)]
    pub fn first_form(&self) -> Sym2 {
        let [a, b] = self.first;
        Sym2::new(a.length_squared(), a.dot(b), b.length_squared())
    }

    /// Unit normal `S_2 × S_1/‖·‖`: towards who sees columns run right and rows down. Not finite where the surface
    /// is degenerate.
    #[must_use]
    pub fn normal(&self) -> DVec3 {
        let [a, b] = self.first;
        b.cross(a).normalize()
    }

    /// Second fundamental form `B_ij = S_ij · n`. Positive along `v` where the surface bends towards the normal.
    #[must_use]
    pub fn second_form(&self) -> Sym2 {
        let normal = self.normal();
        let [xx, xy, yy] = self.second.map(|s| s.dot(normal));
        Sym2::new(xx, xy, yy)
    }

    /// Whether the surface has a tangent plane there: `S_1` and `S_2` are neither 0 nor parallel, but for rounding.
    #[must_use]
    #[inline(always)]
    pub fn is_regular(&self) -> bool {
        let [a, b] = self.first;
        let square = b.cross(a).length_squared();
        square > 1e-18 * a.length_squared() * b.length_squared() && square.is_finite()
    }

    /// Mean curvature `H = tr(G⁻¹B)/2`, 1/m, and Gaussian curvature `K = det B/det G`, 1/m².
    #[must_use]
    pub fn mean_and_gaussian(&self) -> [f64; 2] {
        let Forms { mean, gaussian, .. } = self.forms();
        [mean, gaussian]
    }

    /// All that the two forms give, from one root and one division: with `N = S_2 × S_1`, `det G = N²` and `B_ij = S_ij·N/|N|`.
    #[inline(always)]
    pub(crate) fn forms(&self) -> Forms {
        let (g, [a, b]) = (self.first_form(), self.first);
        let normal = b.cross(a);
        let inverse_det = normal.length_squared().recip();
        let [xx, xy, yy] = self.second.map(|s| s.dot(normal));
        let second = Sym2::new(xx, xy, yy) * inverse_det.sqrt();
        let inverse = Sym2::new(g.yy, -g.xy, g.xx) * inverse_det;
        let trace = inverse.xx * second.xx + 2.0 * inverse.xy * second.xy + inverse.yy * second.yy;
        Forms { inverse, second, mean: 0.5 * trace, gaussian: second.det() * inverse_det }
    }

    /// `κ1² + κ2² = 4H² − 2K`, 1/m².
    fn squared_curvature(&self) -> f64 {
        let [mean, gaussian] = self.mean_and_gaussian();
        4.0 * mean * mean - 2.0 * gaussian
    }

    /// Area of the surface per unit of the parameters, `√det G`.
    #[must_use]
    #[inline(always)]
    pub fn area(&self) -> f64 {
        self.first[0].cross(self.first[1]).length()
    }
}

/// Ground axes in space: x east, y north, z up, metres, from the north-west node. Where meridians converge, a row is taken at
/// its own spacing.
impl ParametricSurface for HeightSurface {
    fn cols(&self) -> usize {
        self.frame().cols()
    }

    fn rows(&self) -> usize {
        self.frame().rows()
    }

    fn is_void(&self, col: usize, row: usize) -> bool {
        Self::is_void(self, col, row)
    }

    fn space_jet(&self, at: DVec2) -> SurfaceJet {
        on_ground(at, self.frame().spacing(at.y), &self.jet(at))
    }

    fn as_heights(&self) -> Option<&HeightSurface> {
        Some(self)
    }

    /// The means are those of [`rms_curvature`](Self::rms_curvature), over the map.
    fn measures(&self) -> Measures {
        let area = measured(self, |_, _| true).area;
        Measures { area, rms_curvature: self.rms_curvature() }
    }

    fn row_space_jets(&self, row: usize) -> Vec<SurfaceJet> {
        let mut jets = vec![HeightJet::default(); self.frame().cols()];
        self.row_jets(row, &mut jets);
        let spacing = self.frame().spacing(row as f64);
        let at = |col: usize| DVec2::new(col as f64, row as f64);
        jets.iter().enumerate().map(|(col, jet)| on_ground(at(col), spacing, jet)).collect()
    }
}

/// A jet in space, from one along the ground axes where nodes are `x` by `y` metres apart.
#[inline(always)]
pub(super) fn on_ground(at: DVec2, DVec2 { x, y }: DVec2, jet: &HeightJet) -> SurfaceJet {
    let up = |z: f64| DVec3::new(0.0, 0.0, z);
    SurfaceJet {
        point: DVec3::new(at.x * x, -at.y * y, jet.z),
        first: [DVec3::new(x, 0.0, jet.zx * x), DVec3::new(0.0, -y, -jet.zy * y)],
        second: [up(jet.zxx * x * x), up(-jet.zxy * x * y), up(jet.zyy * y * y)],
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::control::Control;
    use crate::surface::FitOptions;
    use crate::synthetic::{Synthetic, SyntheticKind};
    use crate::terrain::Crs;

    #[test]
    fn a_height_surface_in_space_has_its_own_forms() {
        let range = Synthetic::new(SyntheticKind::Range, 30, 20, 25.0).unwrap();
        let terrain = range.terrain(Crs::none(), DVec2::ZERO).unwrap();
        let surface =
            HeightSurface::fit(&terrain, &FitOptions::default(), &Control::default()).unwrap();
        let at = DVec2::new(11.0, 7.0);
        let (height, space) = (surface.jet(at), surface.space_jet(at));
        assert!(space.normal().distance(height.normal()) < 1e-12);
        let [g11, g12, g22] = height.first_form();
        let [b11, b12, b22] = height.second_form();
        let index = DVec2::new(25.0, -25.0);
        for (form, ground) in [
            (space.first_form(), Sym2::new(g11, g12, g22)),
            (space.second_form(), Sym2::new(b11, b12, b22)),
        ] {
            let ground = ground.stretched(index);
            let difference = form + ground * -1.0;
            assert!(difference.xx.abs() + difference.xy.abs() + difference.yy.abs() < 1e-9);
        }
        let of_row = surface.row_space_jets(7)[11];
        assert!((of_row.second[2] - space.second[2]).length() < 1e-12);
        assert_eq!(of_row.first, space.first);
    }
}
