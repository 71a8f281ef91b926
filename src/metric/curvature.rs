//! The curvature tensor CT of the paper, equation (4).

use glam::DVec2;

use super::norm::one_by_one;
use super::{Delta, Metric, MetricOptions, NamedMetric, Norm, SpeedBlock, SpeedTensor, Unit};
use crate::control::Control;
use crate::error::Result;
use crate::linalg::Sym2;
use crate::linalg::simd::{self, Kernel};
use crate::surface::{
    BLOCK, Block, Forms, HeightBlock, HeightJet, Jet, JetBlock, Surface, SurfaceJet,
};

pub(super) const NAMED: NamedMetric = NamedMetric {
    name: "curvature",
    about: "The curvature tensor, in AG units",
    make: |options: &MetricOptions| {
        Ok(Box::new(Curvature { delta: options.delta.unwrap_or_default() }))
    },
};

/// The curvature tensor CT, `D = Σ 1/(δ+|κ_i|) w_i w_iᵀ`: a step along a direction of high normal curvature is costly. An AG
/// unit is `m·√(1/m)`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Curvature {
    /// The offset `δ`.
    pub delta: Delta,
}

impl Metric for Curvature {
    fn name(&self) -> &str {
        NAMED.name
    }

    fn unit(&self) -> Unit {
        Unit::Ag
    }

    fn norm(&self, surface: &dyn Surface, _: &Control) -> Result<Norm> {
        let delta = self.delta.on(surface)?;
        let norm = Norm::quadratic(CurvatureTensor { delta });
        Ok(norm.with_parameter("delta_per_m", delta, "1/m").with_level(delta))
    }
}

/// CT on a surface.
#[derive(Clone, Copy, Debug)]
struct CurvatureTensor {
    /// 1/m.
    delta: f64,
}

impl SpeedTensor for CurvatureTensor {
    fn speed(&self, at: DVec2, jet: &Jet) -> Sym2 {
        self.speed_and_det(at, jet).0
    }

    fn speed_and_det(&self, _: DVec2, jet: &Jet) -> (Sym2, f64) {
        match jet {
            Jet::Height(jet) => of_heights(jet, self.delta),
            Jet::Space(jet) => {
                let d = if jet.is_regular() { in_space(jet, self.delta) } else { Sym2::NAN };
                (d, d.det())
            }
        }
    }

    fn block(&self, block: &Block, jets: &JetBlock, speeds: &mut SpeedBlock) {
        match jets.heights() {
            Some(jets) => simd::dispatch(BlockOfHeights { jets, delta: self.delta, speeds }),
            None => one_by_one(self, block, jets, speeds),
        }
    }
}

/// The tensors of a block of heights.
struct BlockOfHeights<'a> {
    jets: &'a HeightBlock,
    delta: f64,
    speeds: &'a mut SpeedBlock,
}

impl Kernel for BlockOfHeights<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        for j in 0..BLOCK {
            for i in 0..BLOCK {
                self.speeds.set_with(j, i, of_heights(&self.jets.jet(j, i), self.delta));
            }
        }
    }
}

/// `D = Σ_i s_i w_i w_iᵀ` with `s_i = 1/(δ+|κ_i|)`, in ground axes, and its determinant.
///
/// With the shape operator `S = G⁻¹B` this is `f(S) G⁻¹` for `f(κ) = 1/(δ+|κ|)`, and a function of a 2×2
/// matrix is linear in it: `f(S) = a S + b I` with the divided difference `a = (f1−f2)/(κ1−κ2)`.
/// Written out,
///
/// ```text
///   D = ( q G⁻¹BG⁻¹ + c G⁻¹ ) / (δ² + δ(|κ1|+|κ2|) + |K|)
///   K ≥ 0:  q = −sign H,  c = δ + 2|H|            |κ1|+|κ2| = 2|H|
///   K < 0:  q = −H/r,     c = δ + r + H²/r        |κ1|+|κ2| = 2r,  r = √(H²−K)
/// ```
///
/// without directions, so nothing is undetermined at an umbilic, and without cancellation. With the Hessian `Z`,
/// `w = 1 + |∇z|²` and the adjugate `A = w G⁻¹` of `G`, everything scales by powers of `√w`, and of six divisions two
/// are left:
///
/// ```text
///   p = tr(AZ)/2 = H w√w ,   h = det Z = K w² ,   ρ = √(p² − hw) = r w√w ,   e = δ w√w
///   D = √w ( q AZA + c A ) / (e² + e s + |h|w) ,            det D = w² / (e² + e s + |h|w)
///   K ≥ 0:  q = −sign p,  c = e + 2|p|,           s = 2|p|
///   K < 0:  q = −p/ρ,     c = e + ρ + p²/ρ,       s = 2ρ
/// ```
#[inline(always)]
pub(super) fn of_heights(jet: &HeightJet, delta: f64) -> (Sym2, f64) {
    let HeightJet { zx, zy, zxx, zxy, zyy, .. } = *jet;
    let a = Sym2::new(1.0 + zy * zy, -zx * zy, 1.0 + zx * zx);
    let w = 1.0 + zx * zx + zy * zy;
    let root = w.sqrt();
    // AZ, which is not symmetric, and its product with A, which is.
    let (az11, az12) = (a.xx * zxx + a.xy * zxy, a.xx * zxy + a.xy * zyy);
    let (az21, az22) = (a.xy * zxx + a.yy * zxy, a.xy * zxy + a.yy * zyy);
    let aza =
        Sym2::new(az11 * a.xx + az12 * a.xy, az11 * a.xy + az12 * a.yy, az21 * a.xy + az22 * a.yy);
    let p = 0.5 * (az11 + az22);
    let hw = (zxx * zyy - zxy * zxy) * w;
    let e = delta * w * root;
    let saddle = hw < 0.0;
    // At a saddle there is nothing to cancel under the root; elsewhere it is not used.
    let rho = (p * p + hw.abs()).sqrt();
    let q_saddle = -p / rho;
    let (q, c, sum) = if saddle {
        (q_saddle, e + rho - p * q_saddle, 2.0 * rho)
    } else {
        (-1f64.copysign(p), e + 2.0 * p.abs(), 2.0 * p.abs())
    };
    let inverse = 1.0 / (e * e + e * sum + hw.abs());
    ((aza * q + a * c) * (root * inverse), w * w * inverse)
}

/// The same on any surface, in grid coordinates: the first formula above with `H`, `K`, `G` and `B` as they are.
#[inline(always)]
pub(crate) fn in_space(jet: &SurfaceJet, delta: f64) -> Sym2 {
    let Forms { inverse, second: b, mean: h, gaussian: k } = jet.forms();
    let (q, c, sum) = if k < 0.0 {
        let r = (h * h - k).sqrt();
        (-h / r, delta + r + h * h / r, 2.0 * r)
    } else {
        (-1f64.copysign(h), delta + 2.0 * h.abs(), 2.0 * h.abs())
    };
    let raised = b.congruence(inverse);
    (raised * q + inverse * c) * (delta * delta + delta * sum + k.abs()).recip()
}

#[cfg(test)]
mod tests {
    use glam::DVec2;

    use super::*;
    use crate::metric::isotropic;

    /// Σ s_i w_i w_iᵀ by the generalised eigenproblem `B w = κ G w`, as the paper writes it.
    fn by_eigenvectors(jet: &HeightJet, delta: f64) -> Sym2 {
        let g = Sym2::new(1.0, 0.0, 1.0) + Sym2::outer(DVec2::new(jet.zx, jet.zy));
        let w = (1.0 + jet.zx * jet.zx + jet.zy * jet.zy).sqrt();
        let b = Sym2::new(jet.zxx, jet.zxy, jet.zyy) * (1.0 / w);
        // det(B − κG) = 0
        let (qa, qb, qc) = (g.det(), -(g.xx * b.yy + g.yy * b.xx - 2.0 * g.xy * b.xy), b.det());
        let root = (qb * qb - 4.0 * qa * qc).sqrt();
        [(-qb + root) / (2.0 * qa), (-qb - root) / (2.0 * qa)]
            .into_iter()
            .map(|k| {
                let m = b + g * -k;
                let u = if m.xx.abs() + m.xy.abs() > m.yy.abs() + m.xy.abs() {
                    DVec2::new(-m.xy, m.xx)
                } else {
                    DVec2::new(m.yy, -m.xy)
                };
                Sym2::outer(u / g.norm(u)) * (1.0 / (delta + k.abs()))
            })
            .fold(Sym2::default(), |sum, d| sum + d)
    }

    fn close(a: Sym2, b: Sym2) -> bool {
        let scale = b.xx.abs() + b.yy.abs();
        let e = a + b * -1.0;
        e.xx.abs() + e.xy.abs() + e.yy.abs() < 1e-9 * scale
    }

    #[test]
    fn agrees_with_the_principal_directions() {
        for (zxx, zxy, zyy) in
            [(0.02, 0.003, 0.001), (0.02, 0.01, -0.03), (-0.01, 0.002, -0.004), (1e-3, 0.0, -1e-3)]
        {
            for (zx, zy) in [(0.0, 0.0), (0.7, -0.3), (-2.0, 1.5)] {
                let jet = HeightJet { z: 0.0, zx, zy, zxx, zxy, zyy };
                let (d, det) = of_heights(&jet, 0.01);
                assert!(close(d, by_eigenvectors(&jet, 0.01)), "{jet:?}");
                assert!((det / d.det() - 1.0).abs() < 1e-11, "{jet:?}");
            }
        }
    }

    #[test]
    fn planes_and_umbilics_are_isotropic() {
        let plane = HeightJet { zx: 0.4, zy: -0.2, ..HeightJet::default() };
        assert!(close(of_heights(&plane, 0.05).0, isotropic::of_heights(&plane).0 * 20.0));
        let umbilic = HeightJet { zxx: 0.03, zyy: 0.03, ..HeightJet::default() };
        assert!(close(of_heights(&umbilic, 0.01).0, isotropic::of_heights(&umbilic).0 * 25.0));
        let saddle = HeightJet { zxx: 0.03, zyy: -0.03, ..HeightJet::default() };
        assert!(close(of_heights(&saddle, 0.01).0, isotropic::of_heights(&saddle).0 * 25.0));
    }
}
