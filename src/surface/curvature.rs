//! Slope, normal and curvature of a height surface, from its derivatives at one point.
//!
//! All vectors are in ground axes, `x` east and `y` north. Curvature is positive where the surface bends
//! towards its upward normal: in a hollow.

use glam::{DVec2, DVec3};

use super::HeightJet;
use super::bspline::block::{BLOCK, HeightBlock, Lanes};
use crate::linalg::Sym2;
use crate::linalg::simd::Kernel;

/// Curvatures of a surface at one point, with the directions of the principal ones.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PrincipalCurvatures {
    /// Gaussian curvature `K = κ1 κ2`, 1/m².
    pub gaussian: f64,
    /// Mean curvature `H = (κ1 + κ2)/2`, 1/m.
    pub mean: f64,
    /// Principal curvatures `κ1 ≥ κ2`, 1/m.
    pub principal: [f64; 2],
    /// Principal directions `w1, w2` in ground axes, `w_iᵀ G w_j = δ_ij`: projections onto the map of orthogonal unit
    /// tangents. Their signs are arbitrary, and at an umbilic so is the pair.
    pub directions: [DVec2; 2],
}

impl HeightJet {
    /// Gradient `∇z`: points uphill, its length is the tangent of the slope.
    #[must_use]
    #[inline(always)]
    pub fn gradient(&self) -> DVec2 {
        DVec2::new(self.zx, self.zy)
    }

    /// Angle in radians between surface and horizontal, 0 to π/2.
    #[must_use]
    pub fn slope(&self) -> f64 {
        self.gradient().length().atan()
    }

    /// Upward unit normal `(−zx, −zy, 1)/√(1+|∇z|²)`.
    #[must_use]
    pub fn normal(&self) -> DVec3 {
        DVec3::new(-self.zx, -self.zy, 1.0) / self.area_factor()
    }

    /// First fundamental form `G = I + ∇z ∇zᵀ`: `√(vᵀGv)` is the length on the surface of a vector `v` on the map.
    #[must_use]
    pub fn first_form(&self) -> Sym2 {
        Sym2::new(1.0 + self.zx * self.zx, self.zx * self.zy, 1.0 + self.zy * self.zy)
    }

    /// Second fundamental form `B = Hess z/√(1+|∇z|²)`, 1/m.
    #[must_use]
    pub fn second_form(&self) -> Sym2 {
        let [xx, xy, yy] = [self.zxx, self.zxy, self.zyy].map(|h| h / self.area_factor());
        Sym2::new(xx, xy, yy)
    }

    /// Curvature `vᵀBv / vᵀGv`, 1/m, of the normal section over the direction `v` on the map, whatever its length.
    #[must_use]
    pub fn normal_curvature(&self, v: DVec2) -> f64 {
        self.second_form().form(v) / self.first_form().form(v)
    }

    /// Gaussian, mean and principal curvatures with their directions.
    #[must_use]
    pub fn curvature(&self) -> PrincipalCurvatures {
        // In the G-orthonormal pair along the gradient and the contour, e1 = ĝ/√(1+|∇z|²) and e2 ⊥ ĝ, the
        // pencil B w = κ G w becomes an ordinary symmetric eigenproblem [a b; b c].
        let uphill = self.gradient().normalize_or(DVec2::X);
        let (e1, e2) = (uphill / self.area_factor(), uphill.perp());
        let b = self.second_form();
        let form = |v: DVec2, w: DVec2| {
            b.xx * v.x * w.x + b.xy * (v.x * w.y + v.y * w.x) + b.yy * v.y * w.y
        };
        let (a, b, c) = (form(e1, e1), form(e1, e2), form(e2, e2));
        let (mean, half) = ((a + c) / 2.0, (a - c) / 2.0);
        let radius = half.hypot(b);
        // Of the two expressions for the first eigenvector, the one that does not cancel.
        let axis =
            if half >= 0.0 { DVec2::new(half + radius, b) } else { DVec2::new(b, radius - half) };
        let axis = axis.normalize_or(DVec2::X);
        PrincipalCurvatures {
            gaussian: a * c - b * b,
            mean,
            principal: [mean + radius, mean - radius],
            directions: [axis.x * e1 + axis.y * e2, axis.x * e2 - axis.y * e1],
        }
    }

    /// `κ1² + κ2² = tr (G⁻¹B)² = 4H² − 2K` without the directions, 1/m².
    #[inline(always)]
    fn squared_curvature(&self) -> f64 {
        let (zx, zy) = (self.zx, self.zy);
        // det G, and `tr (G⁻¹ Hess z) det G`
        let area = 1.0 + zx * zx + zy * zy;
        let trace =
            self.zxx * (1.0 + zy * zy) - 2.0 * self.zxy * (zx * zy) + self.zyy * (1.0 + zx * zx);
        let hessian = self.zxx * self.zyy - self.zxy * self.zxy;
        (trace * trace - 2.0 * hessian * area) / (area * area * area)
    }

    /// Surface area per area on the map, `√(1+|∇z|²)`.
    #[inline(always)]
    fn area_factor(&self) -> f64 {
        (1.0 + self.gradient().length_squared()).sqrt()
    }
}

/// Sums over the nodes of a block of `κ1² + κ2²`, 1/m², and of the area, m². Added lane by lane, so that they are the same to the
/// last bit on every instruction set.
pub(super) struct BlockSums<'a> {
    pub(super) jets: &'a HeightBlock,
    /// The area of the map, m², that each node stands for; 0 if it does not count.
    pub(super) map_areas: &'a [Lanes; BLOCK],
}

impl Kernel for BlockSums<'_> {
    type Output = [f64; 2];

    #[inline(always)]
    fn run(self) -> [f64; 2] {
        let (mut squares, mut areas) = ([0.0; BLOCK], [0.0; BLOCK]);
        for (row, map_areas) in self.map_areas.iter().enumerate() {
            for i in 0..BLOCK {
                let jet = self.jets.jet(row, i);
                let (counts, square) = (map_areas[i] > 0.0, jet.squared_curvature());
                squares[i] += if counts { square } else { 0.0 };
                let area = map_areas[i] * jet.area_factor();
                areas[i] += if counts { area } else { 0.0 };
            }
        }
        [squares.iter().sum(), areas.iter().sum()]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn g_product(jet: &HeightJet, v: DVec2, w: DVec2) -> f64 {
        v.dot(w) + jet.gradient().dot(v) * jet.gradient().dot(w)
    }

    /// `w_iᵀGw_j = δ_ij` and `κ_i` is the normal curvature along `w_i`.
    fn check_directions(jet: &HeightJet, tolerance: f64) {
        let PrincipalCurvatures { gaussian, mean, principal, directions: [w1, w2] } =
            jet.curvature();
        assert!((g_product(jet, w1, w1) - 1.0).abs() < 1e-12);
        assert!((g_product(jet, w2, w2) - 1.0).abs() < 1e-12);
        assert!(g_product(jet, w1, w2).abs() < 1e-12);
        assert!((jet.normal_curvature(w1) - principal[0]).abs() < tolerance);
        assert!((jet.normal_curvature(w2) - principal[1]).abs() < tolerance);
        assert!(principal[0] >= principal[1]);
        assert!((principal[0] * principal[1] - gaussian).abs() < tolerance);
        assert!((principal[0] + principal[1] - 2.0 * mean).abs() < tolerance);
        let squares = principal[0].powi(2) + principal[1].powi(2);
        assert!((jet.squared_curvature() - squares).abs() < tolerance);
    }

    #[test]
    fn a_sphere_cap_is_umbilic_everywhere() {
        let radius = 50.0;
        for (x, y) in [(0.0, 0.0), (10.0, -5.0), (0.0, 30.0), (28.0, 28.0)] {
            // z = √(R² − x² − y²), a dome: curvature −1/R in all directions.
            let z = f64::sqrt(radius * radius - x * x - y * y);
            let jet = HeightJet {
                z,
                zx: -x / z,
                zy: -y / z,
                zxx: -1.0 / z - x * x / z.powi(3),
                zxy: -x * y / z.powi(3),
                zyy: -1.0 / z - y * y / z.powi(3),
            };
            let curvature = jet.curvature();
            for kappa in curvature.principal {
                assert!((kappa + 1.0 / radius).abs() < 1e-12);
            }
            assert!((curvature.gaussian - 1.0 / radius.powi(2)).abs() < 1e-12);
            check_directions(&jet, 1e-12);
            let outward = DVec3::new(x, y, z) / radius;
            assert!((jet.normal() - outward).length() < 1e-12);
        }
    }

    #[test]
    fn a_trough_bends_across_its_axis_only() {
        // z = R − √(R² − s²), s measured across an axis that runs along (−sin 0.3, cos 0.3).
        let (radius, s) = (20.0_f64, 9.0_f64);
        let across = DVec2::from_angle(0.3);
        let root = (radius * radius - s * s).sqrt();
        let (first, second) = (s / root, radius * radius / root.powi(3));
        let jet = HeightJet {
            z: radius - root,
            zx: first * across.x,
            zy: first * across.y,
            zxx: second * across.x * across.x,
            zxy: second * across.x * across.y,
            zyy: second * across.y * across.y,
        };
        let curvature = jet.curvature();
        assert!((curvature.principal[0] - 1.0 / radius).abs() < 1e-14);
        assert!(curvature.principal[1].abs() < 1e-14);
        assert!((curvature.directions[1].dot(across)).abs() < 1e-12);
        assert!((jet.slope() - (s / radius).asin()).abs() < 1e-14);
        check_directions(&jet, 1e-14);
    }

    #[test]
    fn planes_and_saddles_are_no_trouble() {
        let plane = HeightJet { zx: 0.3, zy: -2.0, ..Default::default() };
        assert_eq!(plane.curvature().principal, [0.0, 0.0]);
        check_directions(&plane, 1e-15);
        check_directions(&HeightJet::default(), 1e-15);
        check_directions(&HeightJet { zxx: 1.0, zyy: -1.0, ..plane }, 1e-12);
        check_directions(&HeightJet { zxy: 1e-3, zx: 1e-200, ..Default::default() }, 1e-15);
    }
}
