//! Metrics on surfaces in space.

use glam::DVec2;
use rayon::prelude::*;

use super::{Metric, Speed, check_tensors, curvature, length_along};
use crate::control::Control;
use crate::eikonal::TensorField;
use crate::error::Result;
use crate::linalg::Sym2;
use crate::surface::{ParametricSurface, SurfaceJet};

/// A metric bound to a [`ParametricSurface`]: the speed tensor `D` in grid coordinates (column, row), everywhere.
///
/// A height surface may be bound so too, and gives what [`Metric::on`] gives, more slowly.
#[derive(Clone)]
pub struct SurfaceMetric<'a> {
    surface: &'a dyn ParametricSurface,
    speed: Speed,
}

impl Metric {
    /// Binds the metric to any surface in space. An automatic `δ` is resolved from [`ParametricSurface::measures`]; on a surface
    /// without curvature it is the inverse of the square root of the area.
    ///
    /// # Errors
    /// A `δ` out of range; tensors that are not one per node or not positive definite; cancelled.
    pub fn on_surface<'a>(
        &self,
        surface: &'a dyn ParametricSurface,
        control: &Control,
    ) -> Result<SurfaceMetric<'a>> {
        let speed = match self {
            Self::Isotropic => Speed::Isotropic,
            Self::Curvature(delta) => {
                let measures = surface.measures();
                let delta = delta.resolve(|| measures.rms_curvature, measures.area.sqrt())?;
                Speed::Curvature { delta }
            }
            Self::Difference(difference) => {
                let measures = surface.measures();
                let scale = (measures.rms_curvature, measures.area.sqrt());
                difference.speed(surface, scale, |_| DVec2::ONE, control)?
            }
            Self::Tensor(tensors) => {
                check_tensors(surface, tensors)?;
                Speed::Tensor(tensors.clone())
            }
        };
        Ok(SurfaceMetric { surface, speed })
    }
}

impl<'a> SurfaceMetric<'a> {
    /// The surface.
    #[must_use]
    pub fn surface(&self) -> &'a dyn ParametricSurface {
        self.surface
    }

    /// Unit of the distance: `m` for isotropic, `AG units` otherwise, as in [`MetricField::unit`](super::MetricField::unit).
    #[must_use]
    pub fn unit(&self) -> &'static str {
        if matches!(self.speed, Speed::Isotropic) { "m" } else { "AG units" }
    }

    /// `δ` in 1/m of the curvature tensor, as [`MetricField::delta`](super::MetricField::delta).
    #[must_use]
    pub fn delta(&self) -> Option<f64> {
        self.speed.delta()
    }

    /// `γ1 γ2` of the difference tensor at the nodes, row-major; `None` on other metrics.
    pub(crate) fn gamma_products(&self) -> Option<&[f64]> {
        self.speed.gamma_products()
    }

    /// `D` at grid coordinates; `None` where the surface is degenerate.
    #[must_use]
    pub fn speed(&self, at: DVec2) -> Option<Sym2> {
        let speed = match self.speed.tensors() {
            Some(tensors) => self.bilinear(tensors, at),
            None => self.speed_of(&self.surface.space_jet(at)),
        };
        speed.is_positive_definite().then_some(speed)
    }

    /// The tensors at the nodes, for [`Solver::solve_field`](crate::Solver::solve_field), periodic where the surface is. Nodes that are
    /// void or where the surface is degenerate are closed. Takes 24 bytes per node while it works.
    ///
    /// # Errors
    /// [`Error::Usage`](crate::Error::Usage) for a closed direction of fewer than 3 nodes; cancelled.
    pub fn sample(&self, control: &Control) -> Result<TensorField> {
        let (cols, rows) = (self.surface.cols(), self.surface.rows());
        let speeds: Vec<Vec<Sym2>> = (0..rows)
            .into_par_iter()
            .map(|row| {
                control.check()?;
                Ok(match self.speed.tensors() {
                    Some(tensors) => tensors[row * cols..(row + 1) * cols].to_vec(),
                    None => self
                        .surface
                        .row_space_jets(row)
                        .iter()
                        .map(|jet| self.speed_of(jet))
                        .collect(),
                })
            })
            .collect::<Result<_>>()?;
        let speed = |col: usize, row: usize| {
            let speed = speeds[row][col];
            (!self.surface.is_void(col, row) && speed.is_positive_definite()).then_some(speed)
        };
        TensorField::from_fn(cols, rows, speed, control)?.periodic(self.surface.periodic())
    }

    /// Length under this metric of a polyline in grid coordinates, as [`MetricField::length`](super::MetricField::length); `NaN` if it
    /// meets a place where the surface is degenerate.
    #[must_use]
    pub fn length(&self, line: &[DVec2]) -> f64 {
        length_along(line, |at, by| self.grid_metric(at).norm(by))
    }

    /// Metric `M = D⁻¹` in grid coordinates; not finite where the surface is degenerate.
    pub(crate) fn grid_metric(&self, at: DVec2) -> Sym2 {
        self.speed(at).map_or(NOWHERE, Sym2::inverse)
    }

    /// `D` from a jet; not finite where it is degenerate.
    fn speed_of(&self, jet: &SurfaceJet) -> Sym2 {
        match self.speed {
            _ if !jet.is_regular() => NOWHERE,
            Speed::Curvature { delta } => curvature::of_surface(jet, delta),
            _ => jet.first_form().inverse(),
        }
    }

    /// Between the nodes around that have a tensor.
    fn bilinear(&self, tensors: &[Sym2], at: DVec2) -> Sym2 {
        let counts = [self.surface.cols(), self.surface.rows()];
        let corners = [0, 1].map(|axis| {
            let (count, last) = (counts[axis] as f64, (counts[axis] - 1) as f64);
            let periodic = self.surface.periodic()[axis];
            let at = if periodic { at[axis].rem_euclid(count) } else { at[axis].clamp(0.0, last) };
            let first = at as usize;
            let next = if periodic {
                (first + 1) % counts[axis]
            } else {
                (first + 1).min(counts[axis] - 1)
            };
            [(first % counts[axis], 1.0 - at.fract()), (next, at.fract())]
        });
        let mut sum = Sym2::default();
        for (row, v) in corners[1] {
            for (col, u) in corners[0] {
                let speed = tensors[row * counts[0] + col];
                if u * v > 0.0 && speed.is_positive_definite() {
                    sum = sum + speed * (u * v);
                }
            }
        }
        sum
    }
}

/// No tensor.
const NOWHERE: Sym2 = Sym2::new(f64::NAN, f64::NAN, f64::NAN);

impl std::fmt::Debug for SurfaceMetric<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("SurfaceMetric").field("speed", &self.speed).finish_non_exhaustive()
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::eikonal::{Solver, Stop};
    use crate::metric::{Delta, Modifiers};
    use crate::surface::{FitOptions, HeightSurface};
    use crate::synthetic::{Synthetic, SyntheticKind};
    use crate::terrain::{Crs, Terrain};

    fn surfaces() -> impl Iterator<Item = HeightSurface> {
        [SyntheticKind::Fractal, SyntheticKind::Sphere].into_iter().map(|kind| {
            let synthetic = Synthetic::new(kind, 40, 30, 25.0).unwrap();
            let terrain = synthetic.terrain(Crs::none(), DVec2::ZERO).unwrap();
            let mut heights = terrain.heights().to_vec();
            heights[410] = f64::NAN;
            let terrain = Terrain::new(terrain.frame().clone(), heights, Crs::none()).unwrap();
            HeightSurface::fit(&terrain, &FitOptions::default(), &Control::default()).unwrap()
        })
    }

    #[test]
    fn height_surfaces_have_one_metric_either_way() {
        let tensors: Arc<[Sym2]> =
            (0..1200).map(|i| Sym2::new(2.0 + f64::from(i).sin(), 0.5, 1.0)).collect();
        let control = Control::default();
        for surface in surfaces() {
            let difference = Metric::Difference(Default::default());
            for metric in [Metric::Isotropic, Metric::Curvature(Delta::default()), difference] {
                let fast = metric.on(&surface, &Modifiers::default(), &Control::default()).unwrap();
                let general = metric.on_surface(&surface, &Control::default()).unwrap();
                assert_eq!((fast.unit(), fast.delta()), (general.unit(), general.delta()));
                for at in [DVec2::new(3.0, 4.0), DVec2::new(20.3, 11.7), DVec2::new(39.0, 29.0)] {
                    let (a, b) = (fast.grid_metric(at), general.grid_metric(at));
                    let e = a + b * -1.0;
                    assert!(
                        e.xx.abs() + e.xy.abs() + e.yy.abs() < 1e-9 * (a.xx + a.yy),
                        "{metric:?}"
                    );
                }
                let solve = |field| {
                    let start = DVec2::new(12.3, 14.6);
                    Solver::default()
                        .solve_field(field, &[start.into()], &Stop::Never, &control)
                        .unwrap()
                };
                let a = solve(TensorField::sample(&fast, &control).unwrap());
                let b = solve(general.sample(&control).unwrap());
                for (a, b) in a.to_row_major().into_iter().zip(b.to_row_major()) {
                    assert!(a == b || (a - b).abs() < 1e-4 * b, "{metric:?}: {a} {b}");
                }
            }
            let general =
                Metric::Tensor(tensors.clone()).on_surface(&surface, &Control::default()).unwrap();
            let d = general.speed(DVec2::new(3.5, 4.0)).unwrap();
            assert!((d.xx - 0.5 * (tensors[163].xx + tensors[164].xx)).abs() < 1e-12);
            assert!(
                Metric::Tensor(tensors[1..].into())
                    .on_surface(&surface, &Control::default())
                    .is_err()
            );
            assert!(
                Metric::Curvature(Delta::Auto(-1.0))
                    .on_surface(&surface, &Control::default())
                    .is_err()
            );
        }
    }
}
