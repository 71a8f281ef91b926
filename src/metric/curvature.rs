//! The curvature tensor CT of the paper, equation (4).

use super::Sym2;
use crate::HeightJet;

/// `G⁻¹`: the speed tensor of the geodesic distance.
pub(super) fn isotropic(jet: &HeightJet) -> Sym2 {
    let HeightJet { zx, zy, .. } = *jet;
    Sym2::new(1.0 + zy * zy, -zx * zy, 1.0 + zx * zx) * (1.0 + zx * zx + zy * zy).recip()
}

/// `D = Σ_i s_i w_i w_iᵀ` with `s_i = 1/(δ+|κ_i|)`, in ground axes.
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
/// without directions, so nothing is undetermined at an umbilic, and without cancellation.
pub(super) fn curvature(jet: &HeightJet, delta: f64) -> Sym2 {
    let inverse_first = isotropic(jet);
    let w2 = 1.0 + jet.zx * jet.zx + jet.zy * jet.zy;
    let second = Sym2::new(jet.zxx, jet.zxy, jet.zyy) * w2.sqrt().recip();
    let gaussian = second.det() / w2;
    let mean = 0.5
        * (inverse_first.xx * second.xx
            + 2.0 * inverse_first.xy * second.xy
            + inverse_first.yy * second.yy);
    let (q, c, sum) = if gaussian >= 0.0 {
        (-mean.signum(), delta + 2.0 * mean.abs(), 2.0 * mean.abs())
    } else {
        let r = (mean * mean - gaussian).sqrt();
        (-mean / r, delta + r + mean * mean / r, 2.0 * r)
    };
    (inverse_first.sandwich(second) * q + inverse_first * c)
        * (delta * delta + delta * sum + gaussian.abs()).recip()
}

#[cfg(test)]
mod tests {
    use glam::DVec2;

    use super::*;

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
                assert!(close(curvature(&jet, 0.01), by_eigenvectors(&jet, 0.01)), "{jet:?}");
            }
        }
    }

    #[test]
    fn planes_and_umbilics_are_isotropic() {
        let plane = HeightJet { zx: 0.4, zy: -0.2, ..HeightJet::default() };
        assert!(close(curvature(&plane, 0.05), isotropic(&plane) * 20.0));
        let umbilic = HeightJet { zxx: 0.03, zyy: 0.03, ..HeightJet::default() };
        assert!(close(curvature(&umbilic, 0.01), isotropic(&umbilic) * 25.0));
        let saddle = HeightJet { zxx: 0.03, zyy: -0.03, ..HeightJet::default() };
        assert!(close(curvature(&saddle, 0.01), isotropic(&saddle) * 25.0));
    }
}
