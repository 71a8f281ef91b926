//! Metrics of a user's own, on heights and on a surface in space.

use std::f64::consts::PI;

use ridgeway::glam::{DVec2, DVec3};
use ridgeway::metric::{Metric, Norm, Unit};
use ridgeway::route::trace;
use ridgeway::surface::Jet;
use ridgeway::synthetic::{Synthetic, SyntheticKind};
use ridgeway::{
    Control, Crs, Error, FitOptions, HeightSurface, Modifiers, NurbsCurve, NurbsGrid, NurbsSurface,
    Result, Solver, Stop, Surface, Sym2,
};

/// Walks at `pace` metres per second, half as fast in the first half of the columns.
#[derive(Debug)]
struct Walk {
    pace: f64,
}

impl Metric for Walk {
    fn name(&self) -> &str {
        "walk"
    }

    fn unit(&self) -> Unit {
        Unit::Named("s")
    }

    fn norm(&self, surface: &dyn Surface, _: &Control) -> Result<Norm> {
        let (pace, middle) = (self.pace, 0.5 * (surface.cols() - 1) as f64);
        let speed = move |at: DVec2| if at.x < middle { 0.5 * pace } else { pace };
        let tensor = move |at: DVec2, jet: &Jet| jet.first_form().inverse() * speed(at).powi(2);
        Ok(Norm::quadratic(tensor).with_parameter("pace_m_per_s", pace, "m/s"))
    }
}

/// Costs 1 per metre to the east and 2 to the west.
#[derive(Debug)]
struct Wind;

impl Metric for Wind {
    fn name(&self) -> &str {
        "wind"
    }

    fn unit(&self) -> Unit {
        Unit::Metres
    }

    fn norm(&self, _: &dyn Surface, _: &Control) -> Result<Norm> {
        let cost = |_: DVec2, jet: &Jet, v: DVec2| {
            jet.first_form().norm(v) * if v.x < 0.0 { 2.0 } else { 1.0 }
        };
        Ok(Norm::general(cost))
    }
}

/// Level ground of 101 × 41 cells of 10 m.
fn plain() -> HeightSurface {
    let plane = Synthetic::new(SyntheticKind::Plane, 101, 41, 10.0).unwrap();
    let terrain = plane.terrain(Crs::none(), DVec2::ZERO).unwrap();
    HeightSurface::fit(&terrain, &FitOptions::default(), &Control::default()).unwrap()
}

/// A half pipe of radius 2 m and length 3 m.
fn half_pipe() -> NurbsGrid {
    let ring = |z: f64| NurbsCurve::ellipse(DVec3::Z * z, DVec3::X * 2.0, DVec3::Y * 2.0).unwrap();
    NurbsSurface::ruled(&ring(3.0), &ring(0.0)).unwrap().on_grid(200, 61).unwrap()
}

#[test]
fn a_metric_of_ones_own_is_solved_and_traced_on_any_surface() {
    let (heights, pipe) = (plain(), half_pipe());
    let control = Control::default();
    // Along a row through both halves: as long in the slow as in the fast one.
    let along = heights.frame().mid_spacing().x * 60.0;
    let slope = heights.jet(DVec2::ZERO).gradient().x;
    let on_heights = along * (1.0 + slope * slope).sqrt();
    let around = 2.0 * PI * 2.0 * 60.0 / 200.0;
    let cases: [(&dyn Surface, [DVec2; 2], f64); 2] = [
        (&heights, [DVec2::new(20.0, 20.0), DVec2::new(80.0, 20.0)], on_heights),
        (&pipe, [DVec2::new(69.5, 30.0), DVec2::new(129.5, 30.0)], around),
    ];
    for (surface, [start, goal], length) in cases {
        let metric = Walk { pace: 1.5 }.on(surface, &Modifiers::default(), &control).unwrap();
        let seconds = 0.5 * length / 0.75 + 0.5 * length / 1.5;
        let map = Solver::default().solve(&metric, &[start.into()], &Stop::Never, &control);
        let map = map.unwrap();
        assert_eq!(map.unit().to_string(), "s");
        let distance = map.at(goal).unwrap();
        assert!((distance / seconds - 1.0).abs() < 0.02, "{distance} {seconds}");
        let route = trace(&map, &metric, goal).unwrap();
        assert!((route.summary.cost / seconds - 1.0).abs() < 0.02, "{:?}", route.summary);
        assert!((route.summary.length_m / length - 1.0).abs() < 0.02, "{:?}", route.summary);
        assert_eq!(route.summary.cost_unit, Unit::Named("s"));
        assert_eq!(metric.parameter("pace_m_per_s"), Some(1.5));
        assert!(!route.profile(surface, 1.0).is_empty());
    }
}

#[test]
fn a_metric_without_a_quadratic_form_measures_but_is_not_solved() {
    let (surface, control) = (plain(), Control::default());
    let metric = Wind.on(&surface, &Modifiers::default(), &control).unwrap();
    let [west, east] = [DVec2::new(10.0, 5.0), DVec2::new(30.0, 5.0)];
    let [there, back] = [metric.length(&[west, east]), metric.length(&[east, west])];
    assert!((back / there - 2.0).abs() < 1e-12, "{there} {back}");
    assert!(metric.speed(west).is_none());

    let solved = Solver::default().solve(&metric, &[west.into()], &Stop::Never, &control);
    let refusal = solved.unwrap_err().to_string();
    assert!(refusal.contains("the metric wind is one without a quadratic form"), "{refusal}");
    let plain = ridgeway::metric::Tensor { tensors: vec![Sym2::new(1.0, 0.0, 1.0); 4141].into() };
    let plain = plain.on(&surface, &Modifiers::default(), &control).unwrap();
    let map = Solver::default().solve(&plain, &[west.into()], &Stop::Never, &control).unwrap();
    assert!(!matches!(trace(&map, &metric, east), Ok(_) | Err(Error::NoPath { .. })));
}

#[test]
fn modifiers_compose_with_metrics_of_ones_own() {
    let (surface, control) = (half_pipe(), Control::default());
    let none = Modifiers::default();
    let costly = Modifiers { cost: Some(vec![3.0; 200 * 61].into()), ..none.clone() };
    let steady = Modifiers { climb_weight: 8.0, ..none.clone() };
    let steep = Modifiers { max_slope_deg: Some(80.0), ..none.clone() };
    let metrics: [&dyn Metric; 2] = [&Walk { pace: 1.0 }, &Wind];
    for metric in metrics {
        let on = |modifiers| metric.on(&surface, modifiers, &control).unwrap();
        // Rows run along the pipe, which stands upright: all that is gone is climbed.
        let cost = |modifiers| on(modifiers).step_cost(DVec2::new(40.0, 30.0), DVec2::Y * 0.1);
        assert!((cost(&costly) / cost(&none) - 3.0).abs() < 1e-6, "{metric:?}");
        assert!(cost(&steady) > cost(&none), "{metric:?}");
        assert!(on(&none).is_open(40, 30) && !on(&steep).is_open(40, 30), "{metric:?}");
    }
}
