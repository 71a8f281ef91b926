//! Jets: what is known of a surface at one point.
//!
//! A jet is the value of a smooth map and its first and second derivatives: all that first and second fundamental form, and so
//! every metric, depend on. Heights over ground axes need six numbers ([`HeightJet`]), a map into space eighteen
//! ([`SurfaceJet`]); [`Jet`] is either and answers the same questions.

use glam::{DVec2, DVec3};

use crate::linalg::Sym2;

/// A point of a surface and the derivatives there, in the axes of the surface ([`Surface::axes`](super::Surface::axes)).
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Jet {
    /// Of a graph `z(x, y)` in ground axes.
    Height(HeightJet),
    /// Of a map `S(u)` into space in grid coordinates.
    Space(SurfaceJet),
}

impl Jet {
    /// First fundamental form `G`: a step `v` has the length `√(vᵀGv)` on the surface.
    #[must_use]
    pub fn first_form(&self) -> Sym2 {
        match self {
            Self::Height(jet) => jet.first_form(),
            Self::Space(jet) => jet.first_form(),
        }
    }

    /// Second fundamental form `B`; positive along `v` where the surface bends towards its normal.
    #[must_use]
    pub fn second_form(&self) -> Sym2 {
        match self {
            Self::Height(jet) => jet.second_form(),
            Self::Space(jet) => jet.second_form(),
        }
    }

    /// Unit normal: upward on heights, else as [`SurfaceJet::normal`].
    #[must_use]
    pub fn normal(&self) -> DVec3 {
        match self {
            Self::Height(jet) => jet.normal(),
            Self::Space(jet) => jet.normal(),
        }
    }

    /// Mean curvature `H`, 1/m, and Gaussian curvature `K`, 1/m².
    #[must_use]
    pub fn mean_and_gaussian(&self) -> [f64; 2] {
        match self {
            Self::Height(jet) => {
                let curvature = jet.curvature();
                [curvature.mean, curvature.gaussian]
            }
            Self::Space(jet) => jet.mean_and_gaussian(),
        }
    }

    /// Normal curvature `vᵀBv / vᵀGv` along a step `v`, 1/m.
    #[must_use]
    pub fn normal_curvature(&self, v: DVec2) -> f64 {
        match self {
            Self::Height(jet) => jet.normal_curvature(v),
            Self::Space(jet) => jet.second_form().form(v) / jet.first_form().form(v),
        }
    }

    /// Rise of the third axis per step, so that a step `v` climbs by `rise · v`.
    #[must_use]
    #[inline(always)]
    pub fn rise(&self) -> DVec2 {
        match self {
            Self::Height(jet) => DVec2::new(jet.zx, jet.zy),
            Self::Space(jet) => DVec2::new(jet.first[0].z, jet.first[1].z),
        }
    }

    /// Gradient `∇z` of the height over the plane of the first two axes, the third being up. Not finite where the surface
    /// stands upright.
    #[must_use]
    pub fn gradient(&self) -> DVec2 {
        match self {
            Self::Height(jet) => jet.gradient(),
            Self::Space(jet) => {
                let normal = jet.second_cross_first();
                -normal.truncate() / normal.z
            }
        }
    }

    /// Whether the surface has a tangent plane there, see [`SurfaceJet::is_regular`].
    #[must_use]
    #[inline(always)]
    pub fn is_regular(&self) -> bool {
        match self {
            Self::Height(_) => true,
            Self::Space(jet) => jet.is_regular(),
        }
    }

    /// The jet by grid coordinates in space; one of heights at `at`, where a step along columns and rows measures `axes`.
    #[must_use]
    #[inline(always)]
    pub fn in_space(&self, at: DVec2, axes: DVec2) -> SurfaceJet {
        match self {
            Self::Height(jet) => jet.in_space(at, axes),
            Self::Space(jet) => *jet,
        }
    }
}

/// Height and its derivatives at one point, in metres, along the ground axes: `x` east, `y` **north**.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct HeightJet {
    /// Height, m.
    pub z: f64,
    /// `∂z/∂x`.
    pub zx: f64,
    /// `∂z/∂y`.
    pub zy: f64,
    /// `∂²z/∂x²`, 1/m.
    pub zxx: f64,
    /// `∂²z/∂x∂y`, 1/m.
    pub zxy: f64,
    /// `∂²z/∂y²`, 1/m.
    pub zyy: f64,
}

impl HeightJet {
    /// The jet by grid coordinates in space: see [`Jet::in_space`].
    #[must_use]
    #[inline(always)]
    pub(crate) fn in_space(&self, at: DVec2, DVec2 { x, y }: DVec2) -> SurfaceJet {
        let up = |z: f64| DVec3::new(0.0, 0.0, z);
        SurfaceJet {
            point: DVec3::new(at.x * x, at.y * y, self.z),
            first: [DVec3::new(x, 0.0, self.zx * x), DVec3::new(0.0, y, self.zy * y)],
            second: [up(self.zxx * x * x), up(self.zxy * x * y), up(self.zyy * y * y)],
        }
    }
}

/// A point of a surface in space and the derivatives there by the two parameters.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SurfaceJet {
    /// The point `S`, m.
    pub point: DVec3,
    /// First derivatives `S_1` and `S_2`, m per unit of the parameter.
    pub first: [DVec3; 2],
    /// Second derivatives `S_11`, `S_12` and `S_22`.
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

    /// Unit normal `S_2 × S_1/‖·‖`: towards a viewer who sees columns run right and rows down. Not finite where the surface
    /// is degenerate.
    #[must_use]
    pub fn normal(&self) -> DVec3 {
        self.second_cross_first().normalize()
    }

    /// `S_2 × S_1`, along the normal.
    #[inline(always)]
    fn second_cross_first(&self) -> DVec3 {
        self.first[1].cross(self.first[0])
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
    pub(super) fn squared_curvature(&self) -> f64 {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::control::Control;
    use crate::surface::{FitOptions, HeightSurface, Surface};
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
        let index = DVec2::new(25.0, -25.0);
        for (form, ground) in
            [(space.first_form(), height.first_form()), (space.second_form(), height.second_form())]
        {
            let ground = ground.rescale(index);
            let difference = form + ground * -1.0;
            assert!(difference.xx.abs() + difference.xy.abs() + difference.yy.abs() < 1e-9);
        }
        let of_row = surface.row_space_jets(7)[11];
        assert!((of_row.second[2] - space.second[2]).length() < 1e-12);
        assert_eq!(of_row.first, space.first);
    }
}
