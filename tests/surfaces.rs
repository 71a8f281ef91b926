//! Distances and routes on surfaces in space, against closed forms.

use std::f64::consts::{FRAC_1_SQRT_2, PI, TAU};

use glam::{DVec2, DVec3, DVec4};
use proptest::prelude::*;
use ridgeway::eikonal::TensorField;
use ridgeway::route::trace;
use ridgeway::{
    Accuracy, Control, Curvature, Delta, DistanceMap, Isotropic, Knots, Metric, MetricField,
    Modifiers, NurbsCurve, NurbsGrid, NurbsSurface, Solver, StartRegion, Stop, Surface,
};

const DELTA: f64 = 0.3;
const RADIUS: f64 = 2.0;

fn curvature(surface: &NurbsGrid) -> MetricField<'_> {
    Curvature { delta: Delta::Absolute(DELTA) }
        .on(surface, &Modifiers::default(), &Control::default())
        .unwrap()
}

fn solve(
    metric: &MetricField<'_>,
    start: impl Into<StartRegion>,
    accuracy: Accuracy,
) -> DistanceMap {
    let control = Control::default();
    let solver = Solver { accuracy, ..Solver::default() };
    solver.solve(metric, &[start.into()], &Stop::Never, &control).unwrap()
}

/// Mean and greatest error over all nodes, as shares of the greatest distance.
fn errors(surface: &NurbsGrid, map: &DistanceMap, exact: impl Fn(DVec3) -> f64) -> [f64; 2] {
    let (mut sum, mut worst, mut most) = (0.0, 0.0_f64, 0.0_f64);
    for row in 0..map.rows() {
        for (col, jet) in surface.row_space_jets(row).into_iter().enumerate() {
            let (g, exact) = (map.at_node(col, row), exact(jet.point));
            sum += (g - exact).abs();
            worst = worst.max((g - exact).abs());
            most = most.max(exact);
        }
    }
    [sum / (map.rows() * map.cols()) as f64 / most, worst / most]
}

/// Errors at 1, 2 and 4 times as fine a grid must fall at least with these orders.
fn check_order(name: &str, errors: [[f64; 2]; 3], least: [f64; 2], most_at_last: f64) {
    let order = |k: usize| (errors[0][k] / errors[2][k]).log2() / 2.0;
    println!("{name}: {errors:?}, orders {:.2} {:.2}", order(0), order(1));
    assert!(order(0) >= least[0] && order(1) >= least[1], "{name}");
    assert!(errors[2][0] < most_at_last, "{name}");
}

/// A sphere about the origin from pole to pole.
fn sphere() -> NurbsSurface {
    let half = [
        [0.0, 1.0, 1.0],
        [1.0, 1.0, FRAC_1_SQRT_2],
        [1.0, 0.0, 1.0],
        [1.0, -1.0, FRAC_1_SQRT_2],
        [0.0, -1.0, 1.0],
    ];
    let points = half.map(|[x, z, w]| DVec4::new(RADIUS * x, 0.0, RADIUS * z, w));
    let knots = Knots::new(2, vec![0.0, 0.0, 0.0, 0.5, 0.5, 1.0, 1.0, 1.0]).unwrap();
    let profile = NurbsCurve::new(knots, false, &points).unwrap();
    NurbsSurface::revolve(&profile, DVec3::ZERO, DVec3::Z).unwrap()
}

/// Errors of the distances from `start` (a share of the grid) on a sphere under the curvature metric: the angle times `R/√s`,
/// `s = 1/(δ + 1/R)`.
fn sphere_errors(sphere: &NurbsSurface, start: DVec2, accuracy: Accuracy, n: usize) -> [f64; 2] {
    let surface = sphere.clone().on_grid(2 * n, n + 1).unwrap();
    let start = start * DVec2::new(2.0, 1.0) * n as f64;
    let map = solve(&curvature(&surface), start, accuracy);
    // The jet at a pole is not quite that of the pole.
    let from = if start.y == 0.0 { DVec3::Z } else { surface.space_jet(start).point.normalize() };
    let per_radian = RADIUS * (DELTA + 1.0 / RADIUS).sqrt();
    errors(&surface, &map, |p| from.cross(p).length().atan2(from.dot(p)) * per_radian)
}

#[test]
fn great_circles_on_a_sphere_through_its_poles() {
    let starts = [("pole", 0.0), ("next to the pole", 0.05), ("middle", 0.37), ("equator", 0.5)];
    for (name, row) in starts {
        for (accuracy, least, most) in
            [(Accuracy::Fast, [0.9, 0.65], 1e-3), (Accuracy::High, [1.2, 0.5], 6e-5)]
        {
            let of = |n| sphere_errors(&sphere(), DVec2::new(0.15, row), accuracy, n);
            let name = format!("sphere, {name}, {accuracy:?}");
            check_order(&name, [50, 100, 200].map(of), least, most);
        }
    }
}

#[test]
fn a_sphere_on_other_parameters_is_the_same() {
    let along = sphere().reweighted(1, 0.4).unwrap();
    // At the seam the parameters of this one have a jump, which is of first order.
    let around = sphere().reweighted(0, 1.5).unwrap();
    for (name, sphere, accuracy, least, most) in [
        ("along", &along, Accuracy::Fast, [0.9, 0.65], 2e-3),
        ("along", &along, Accuracy::High, [1.8, 0.5], 2e-5),
        ("around", &around, Accuracy::Fast, [0.9, 0.65], 2e-3),
        ("around", &around, Accuracy::High, [0.9, 0.65], 3e-4),
    ] {
        let of = |n| sphere_errors(sphere, DVec2::new(0.15, 0.6), accuracy, n);
        let name = format!("reweighted {name}, {accuracy:?}");
        check_order(&name, [50, 100, 200].map(of), least, most);
    }
}

#[test]
fn helices_on_a_closed_cylinder() {
    let ring = |z: f64| NurbsCurve::ellipse(DVec3::Z * z, DVec3::X, DVec3::Y).unwrap();
    let cylinder = NurbsSurface::ruled(&ring(2.0), &ring(-2.0)).unwrap();
    let [s1, s2] = [1.0 / (DELTA + 1.0), 1.0 / DELTA];
    for (accuracy, least, most) in
        [(Accuracy::Fast, [0.9, 0.8], 3e-4), (Accuracy::High, [1.8, 1.7], 1e-5)]
    {
        let of = |n: usize| {
            let surface = cylinder.clone().on_grid(2 * n, n + 1).unwrap();
            let start = DVec2::new(1.9, 0.3) * n as f64;
            let map = solve(&curvature(&surface), start, accuracy);
            let from = surface.space_jet(start).point;
            let exact = |p: DVec3| {
                let turn = (p.y.atan2(p.x) - from.y.atan2(from.x)).rem_euclid(TAU);
                let (a, y) = (turn.min(TAU - turn), p.z - from.z);
                (a * a / s1 + y * y / s2).sqrt()
            };
            errors(&surface, &map, exact)
        };
        check_order(&format!("cylinder, {accuracy:?}"), [40, 80, 160].map(of), least, most);
    }
}

#[test]
fn planes_of_any_parameters_are_flat() {
    let points = |from: DVec3, to: DVec3| NurbsCurve::polyline(&[from, to]).unwrap();
    let normal = DVec3::new(0.3, -0.5, 1.0);
    let at = |x: f64, y: f64| DVec3::new(x, y, -(normal.x * x + normal.y * y));
    let plane = NurbsSurface::ruled(
        &points(at(0.0, 0.0), at(3.0, 0.5)),
        &points(at(0.5, 2.0), at(2.0, 3.0)),
    )
    .unwrap()
    .reweighted(0, 2.0)
    .unwrap();
    let of = |n: usize| {
        let surface = plane.clone().on_grid(n + 1, n + 1).unwrap();
        let start = DVec2::new(0.4, 0.3) * n as f64;
        let map = solve(&curvature(&surface), start, Accuracy::Fast);
        let from = surface.space_jet(start).point;
        errors(&surface, &map, |p| p.distance(from) * DELTA.sqrt())
    };
    check_order("plane", [50, 100, 200].map(of), [0.9, 0.9], 1e-3);
}

#[test]
fn a_torus_is_closed_both_ways_and_symmetric() {
    let (big, small) = (3.0, 1.0);
    let profile = NurbsCurve::ellipse(big * DVec3::X, small * DVec3::X, -small * DVec3::Z).unwrap();
    let torus = NurbsSurface::revolve(&profile, DVec3::ZERO, DVec3::Z).unwrap();
    assert_eq!(torus.closed(), [true, true]);
    let surface = torus.on_grid(160, 80).unwrap();
    let metric = Isotropic.on(&surface, &Modifiers::default(), &Control::default()).unwrap();
    let map = solve(&metric, DVec2::ZERO, Accuracy::Fast);
    let far = map.at_node(80, 40);
    for row in 0..80 {
        for col in 0..160 {
            let g = map.at_node(col, row);
            for mirrored in [map.at_node((160 - col) % 160, row), map.at_node(col, (80 - row) % 80)]
            {
                assert!((g - mirrored).abs() < 1e-4 * far, "{col} {row}: {g} {mirrored}");
            }
        }
    }
    // The outer equator is shortest up to near its conjugate point, √(r(R + r)) π along it; circles round the tube to their far side.
    for col in 1..60 {
        let p = surface.space_jet(DVec2::new(f64::from(col), 0.0)).point;
        let length = (big + small) * p.y.atan2(p.x);
        if length < 0.9 * PI * (small * (big + small)).sqrt() {
            assert!((map.at_node(col as usize, 0) / length - 1.0).abs() < 0.01, "{col}");
        }
    }
    for row in 1..=40 {
        let p = surface.space_jet(DVec2::new(0.0, f64::from(row))).point;
        let length = small * (-p.z).atan2(p.x - big).rem_euclid(TAU);
        assert!((map.at_node(0, row as usize) / length - 1.0).abs() < 0.01, "{row}");
    }
}

#[test]
fn routes_are_great_circles_across_seams_and_poles() {
    let surface = sphere().on_grid(160, 81).unwrap();
    let metric = Isotropic.on(&surface, &Modifiers::default(), &Control::default()).unwrap();
    let start = DVec2::new(150.0, 20.0);
    let map = solve(&metric, start, Accuracy::Fast);
    // Over the seam, next to the pole, and almost exactly over it.
    for goal in [
        DVec2::new(20.0, 30.0),
        DVec2::new(60.0, 14.0),
        DVec2::new(69.0, 12.3),
        DVec2::new(150.0, 70.0),
    ] {
        let route = trace(&map, &metric, goal).unwrap();
        let (from, to) = (surface.space_jet(start).point, surface.space_jet(goal).point);
        assert!(
            route.points[0].distance(from) < 1e-9
                && route.points[route.points.len() - 1].distance(to) < 1e-9
        );
        let exact = RADIUS * from.angle_between(to);
        let normal = from.cross(to).normalize();
        let stray = route.points.iter().map(|p| p.dot(normal).abs()).fold(0.0, f64::max);
        println!("{goal}: {} for {exact}, {stray} m aside", route.summary.cost);
        assert!((route.summary.cost / exact - 1.0).abs() < 2e-3 && stray < 0.05, "{goal}");
        assert!((route.summary.length_m - route.summary.cost).abs() < 1e-9 * exact);
    }
    assert!(trace(&map, &metric, DVec2::new(3.0, 200.0)).is_err());
}

#[test]
fn threads_change_no_bit() {
    let surface = sphere().on_grid(90, 61).unwrap();
    let of = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let metric = Curvature::default()
                .on(&surface, &Modifiers::default(), &Control::default())
                .unwrap();
            (
                metric.parameter("delta_per_m"),
                solve(&metric, DVec2::new(10.2, 20.3), Accuracy::High).to_row_major(),
            )
        })
    };
    assert!(of(1) == of(2) && of(1) == of(4));
}

/// Parameters all over the domain of a surface.
fn parameters(surface: &NurbsSurface) -> impl Iterator<Item = DVec2> + '_ {
    let [[left, right], [bottom, top]] = surface.knots().each_ref().map(Knots::domain);
    let (first, size) = (DVec2::new(left, bottom), DVec2::new(right - left, top - bottom));
    (0..63).map(move |k| {
        let share = DVec2::new((f64::from(k % 9) + 0.4) / 9.0, (f64::from(k / 9) + 0.3) / 7.0);
        first + share * size
    })
}

/// Degree and knots, right or wrong.
fn any_knots() -> impl Strategy<Value = (usize, Vec<f64>)> {
    let step = prop_oneof![4 => Just(0.0), 4 => Just(1.0), 1 => -0.5..3.0, 1 => Just(f64::NAN)];
    (0..5_usize, prop::collection::vec(step, 0..14)).prop_map(|(degree, steps)| {
        let ascend = steps.iter().scan(0.0, |u, step| {
            *u += step;
            Some(*u)
        });
        (degree, ascend.collect())
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    /// Whatever is accepted can be evaluated everywhere, is itself again by way of a file, and bears a metric.
    #[test]
    fn nonsense_is_refused_and_the_rest_is_finite(
        knots in [any_knots(), any_knots()],
        closed in any::<[bool; 2]>(),
        flat in any::<bool>(),
        points in prop::collection::vec([-1.0..1.0, -1.0..1.0, -1.0..1.0, 0.1..2.0f64], 144),
    ) {
        let [Ok(first), Ok(second)] = knots.map(|(degree, knots)| Knots::new(degree, knots)) else {
            return Ok(());
        };
        let count = first.controls() * second.controls();
        let points: Vec<DVec4> = points.into_iter().cycle().take(count).map(DVec4::from).map(|p| if flat { p.with_z(0.0) } else { p }).collect();
        let Ok(surface) = NurbsSurface::new([first, second], closed, &points) else { return Ok(()) };
        for u in parameters(&surface).chain([DVec2::splat(-1e9), DVec2::splat(1e9)]) {
            let jet = surface.jet(u);
            let all = jet.first.iter().chain(&jet.second).chain([&jet.point]);
            prop_assert!(all.into_iter().all(|v| v.is_finite()));
        }
        let again = NurbsSurface::from_json(&surface.to_json()).unwrap();
        prop_assert!(again.jet(DVec2::ONE).point.distance(surface.jet(DVec2::ONE).point) < 1e-12);
        let grid = surface.on_grid(5, 4).unwrap();
        let (none, control) = (Modifiers::default(), Control::default());
        let metric = Curvature::default().on(&grid, &none, &control).unwrap();
        TensorField::sample(&metric, &control).unwrap();
    }
}
