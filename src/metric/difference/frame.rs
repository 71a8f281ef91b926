//! The tangent plane in coordinates that measure lengths.

use glam::DVec2;

use crate::linalg::Sym2;

/// An orthonormal frame `e_1, e_2` of the tangent plane in grid coordinates, `e_1` along `S_1`: with `G = LLᵀ`, `L = [a 0; b c]`,
/// its vectors are the columns of `L⁻ᵀ`.
pub(super) struct Frame {
    a: f64,
    pub(super) b: f64,
    pub(super) c: f64,
}

impl Frame {
    pub(super) fn of(form: Sym2) -> Self {
        let a = form.xx.sqrt();
        Self { a, b: form.xy / a, c: (form.det() / form.xx).sqrt() }
    }

    pub(super) fn vectors(&self) -> [DVec2; 2] {
        let Self { a, b, c } = self;
        [DVec2::new(1.0 / a, 0.0), DVec2::new(-b / (a * c), 1.0 / c)]
    }

    /// A contravariant tensor of the frame in grid coordinates.
    pub(super) fn to_grid(&self, d: Sym2) -> Sym2 {
        let [e1, e2] = self.vectors();
        let mixed = Sym2::outer(e1 + e2) + (Sym2::outer(e1) + Sym2::outer(e2)) * -1.0;
        Sym2::outer(e1) * d.xx + mixed * d.xy + Sym2::outer(e2) * d.yy
    }
}
