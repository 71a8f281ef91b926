//! What must hold on any terrain, through the whole way from heights to routes.

use std::f64::consts::TAU;

use glam::DVec2;
use ridgeway::synthetic::{Synthetic, SyntheticKind, cylinder_distance, sphere_distance};
use ridgeway::{
    Comparison, Control, Crs, Curvature, Delta, Difference, DistanceMap, FitOptions, GridFrame,
    Ground, HeightSurface, Isotropic, Metric, Modifiers, Route, Smoothing, Solver, Stop, Terrain,
    Unit, route::trace,
};

/// A rough terrain of `n × n` nodes.
fn heights(n: usize) -> Vec<f64> {
    Synthetic::new(SyntheticKind::Range, n, n, 30.0).unwrap().with_seed(11).heights()
}

fn terrain(cols: usize, rows: usize, step: DVec2, heights: Vec<f64>) -> Terrain {
    let frame = GridFrame::new(cols, rows, DVec2::new(5e5, 5e6), step, Ground::METRES).unwrap();
    Terrain::new(frame, heights, Crs::none()).unwrap()
}

fn square(n: usize, heights: Vec<f64>) -> Terrain {
    terrain(n, n, DVec2::splat(30.0), heights)
}

struct Planned {
    distance: DistanceMap,
    route: Route,
}

fn plan(terrain: &Terrain, metric: &dyn Metric, start: DVec2, goal: DVec2) -> Planned {
    let control = Control::default();
    let surface = HeightSurface::fit(terrain, &FitOptions::default(), &control).unwrap();
    let field = metric.on(&surface, &Modifiers::default(), &Control::default()).unwrap();
    let distance =
        Solver::default().solve(&field, &[start.into()], &Stop::Never, &control).unwrap();
    let route = trace(&distance, &field, goal).unwrap();
    Planned { distance, route }
}

fn metrics() -> [Box<dyn Metric>; 3] {
    [Box::new(Isotropic), Box::new(Curvature::default()), Box::new(Difference::default())]
}

const N: usize = 81;
const START: DVec2 = DVec2::new(12.0, 70.0);
const GOAL: DVec2 = DVec2::new(66.3, 9.8);

/// Farthest that a point of `a` lies from the line `b`, in cells.
fn deviation(a: &[DVec2], b: &[DVec2]) -> f64 {
    let to_line = |p: &DVec2| {
        let near = b.windows(2).map(|ends| {
            let w = ends[1] - ends[0];
            let t = ((*p - ends[0]).dot(w) / w.length_squared().max(1e-30)).clamp(0.0, 1.0);
            p.distance(ends[0].lerp(ends[1], t))
        });
        near.fold(f64::INFINITY, f64::min)
    };
    a.iter().map(to_line).fold(0.0, f64::max)
}

#[test]
fn scaling_a_terrain_changes_no_route_and_scales_the_isotropic_cost() {
    let unit = square(N, heights(N));
    for scale in [0.25, 16.0, 3.0] {
        let tall = heights(N).into_iter().map(|z| z * scale).collect();
        let scaled = terrain(N, N, DVec2::splat(30.0 * scale), tall);
        for metric in metrics() {
            let (a, b) = (plan(&unit, &metric, START, GOAL), plan(&scaled, &metric, START, GOAL));
            assert!(deviation(&a.route.grid, &b.route.grid) < 0.02, "{metric:?} × {scale}");
            let ratio = b.route.summary.length_m / a.route.summary.length_m / scale;
            assert!((ratio - 1.0).abs() < 1e-3, "{metric:?}: {ratio}");
        }
    }
}

#[test]
fn moving_a_terrain_changes_nothing() {
    let here = square(N, heights(N));
    let lifted = square(N, heights(N).into_iter().map(|z| z + 1000.0).collect());
    for metric in metrics() {
        let (a, b) = (plan(&here, &metric, START, GOAL), plan(&lifted, &metric, START, GOAL));
        assert!(deviation(&a.route.grid, &b.route.grid) < 0.02);
        assert!((a.route.summary.cost / b.route.summary.cost - 1.0).abs() < 1e-4);
    }
}

#[test]
fn mirrored_and_transposed_terrains_have_mirrored_and_transposed_routes() {
    let z = heights(N);
    let last = (N - 1) as f64;
    let remap = |from: fn(usize, usize) -> (usize, usize)| {
        let node = |i: usize| from(i % N, i / N);
        square(N, (0..N * N).map(|i| z[node(i).1 * N + node(i).0]).collect())
    };
    let mirrored = remap(|c, r| (N - 1 - c, r));
    let transposed = remap(|c, r| (r, c));
    let mirror = |p: DVec2| DVec2::new(last - p.x, p.y);
    let transpose = |p: DVec2| DVec2::new(p.y, p.x);
    for metric in metrics() {
        let plain = plan(&square(N, z.clone()), &metric, START, GOAL).route;
        let other = plan(&mirrored, &metric, mirror(START), mirror(GOAL)).route;
        let back: Vec<DVec2> = other.grid.iter().map(|&p| mirror(p)).collect();
        assert!(deviation(&back, &plain.grid) < 0.05, "{metric:?} mirrored");
        let other = plan(&transposed, &metric, transpose(START), transpose(GOAL)).route;
        let back: Vec<DVec2> = other.grid.iter().map(|&p| transpose(p)).collect();
        assert!(deviation(&back, &plain.grid) < 0.05, "{metric:?} transposed");
    }
}

/// What the routes of each metric there and back differ by, as shares of their costs, on rough grounds in ascending order.
fn there_and_back(metric: &dyn Metric) -> [f64; 8] {
    let mut differences = [11, 1, 2, 3, 4, 5, 6, 7].map(|seed| {
        let ground = Synthetic::new(SyntheticKind::Range, N, N, 30.0).unwrap().with_seed(seed);
        let terrain = square(N, ground.heights());
        let cost = |from, to| plan(&terrain, metric, from, to).route.summary.cost;
        (cost(START, GOAL) / cost(GOAL, START) - 1.0).abs()
    });
    differences.sort_by(f64::total_cmp);
    differences
}

#[test]
fn there_and_back_cost_the_same() {
    for metric in metrics() {
        let differences = there_and_back(&metric);
        println!("{metric:?}: {differences:?}");
        // The curvature tensor has kinks, its changes jumps: lines in it are found less sharply, and of two ways around a hill that cost about the same the
        // solver may take either, to its error.
        let [median, most] = match metric.name() {
            "isotropic" => [1e-5, 1e-5],

            _ => [2e-3, 1.5e-2],
        };
        assert!(differences[4] < median && differences[7] < most, "{metric:?}: {differences:?}");
    }
}

#[test]
fn distances_obey_the_triangle_inequality() {
    let terrain = square(N, heights(N));
    let places = [START, GOAL, DVec2::new(40.0, 40.0), DVec2::new(70.5, 71.5)];
    for metric in metrics() {
        let maps = places.map(|at| plan(&terrain, &metric, at, GOAL).distance);
        for a in 0..places.len() {
            for b in 0..places.len() {
                for c in 0..places.len() {
                    let g = |from: usize, to: usize| maps[from].at(places[to]).unwrap();
                    assert!(g(a, c) <= 1.02 * (g(a, b) + g(b, c)), "{a} {b} {c}");
                }
            }
        }
    }
}

#[test]
fn islands_far_from_the_corner_of_the_grid_are_climbed() {
    let middle = DVec2::new(50.0, 30.0);
    let is_land = |i: usize| middle.distance(DVec2::new((i % N) as f64, (i / N) as f64)) < 20.0;
    let heights = heights(N).into_iter().enumerate();
    let island = heights.map(|(i, z)| if is_land(i) { z } else { f64::NAN }).collect();
    let control = Control::default();
    let surface = HeightSurface::fit(&square(N, island), &FitOptions::default(), &control).unwrap();
    let modifiers = Modifiers { climb_weight: 10.0, ..Modifiers::default() };
    let field = Isotropic.on(&surface, &modifiers, &control).unwrap();
    let map = Solver::default().solve(&field, &[middle.into()], &Stop::Never, &control).unwrap();
    let reached = map.to_row_major().iter().filter(|g| g.is_finite()).count();
    assert_eq!(reached, (0..N * N).filter(|&i| is_land(i)).count());
    let goal = DVec2::new(62.0, 38.0);
    let cost = trace(&map, &field, goal).unwrap().summary.cost;
    assert!((map.at(goal).unwrap() / cost - 1.0).abs() < 0.03);
}

#[test]
fn stretched_cells_give_the_same_distances_at_the_same_places() {
    // The same hills on square cells and on cells twice as high as wide.
    let hills = Synthetic::new(SyntheticKind::Bumps, 161, 161, 5.0).unwrap();
    let sample = |cols: usize, rows: usize, step: DVec2| {
        let at = |i: usize| {
            hills.height((i % cols) as f64 * step.x - 400.0, 400.0 - (i / cols) as f64 * step.y)
        };
        terrain(cols, rows, step, (0..cols * rows).map(at).collect())
    };
    let (fine, flat) =
        (sample(161, 161, DVec2::splat(5.0)), sample(161, 81, DVec2::new(5.0, 10.0)));
    let options =
        FitOptions { smoothing: ridgeway::Smoothing::Interpolate, ..FitOptions::default() };
    let control = Control::default();
    for metric in metrics() {
        // Changes from node to node are a derivative more than curvature is.
        let agreement = if metric.name() == "difference" { 0.08 } else { 0.03 };
        let [a, b] = [(&fine, 1.0), (&flat, 2.0)].map(|(terrain, stretch)| {
            let surface = HeightSurface::fit(terrain, &options, &control).unwrap();
            let field = metric.on(&surface, &Modifiers::default(), &Control::default()).unwrap();
            let start = DVec2::new(30.0, 40.0 / stretch);
            let map =
                Solver::default().solve(&field, &[start.into()], &Stop::Never, &control).unwrap();
            move |col: usize, row: usize| map.at_node(col, row / stretch as usize)
        });
        for row in (0..161).step_by(20) {
            for col in (0..161).step_by(20) {
                let (a, b) = (a(col, row), b(col, row));
                assert!(
                    (a - b).abs() < agreement * a.max(b) + 1e-9,
                    "{metric:?} ({col}, {row}): {a} {b}"
                );
            }
        }
    }
}

#[test]
fn a_terrain_in_degrees_is_solved_in_metres() {
    // A flat plane of 0.2° around 60° N: ground distances are those of the ellipsoid.
    let n = 201;
    let step = DVec2::splat(0.001);
    let frame = GridFrame::new(n, n, DVec2::new(10.0, 60.1), step, Ground::WGS84).unwrap();
    let terrain = Terrain::new(frame, vec![0.0; n * n], Crs::from_epsg(4326).unwrap()).unwrap();
    let centre = DVec2::splat(100.0);
    let planned = plan(&terrain, &Isotropic, centre, DVec2::new(190.0, 100.0));
    // 0.09° of longitude at 60° N: 0.09 · 55 800.2 m; of latitude: 0.09 · 111 412.2 m (tables of the NGA).
    assert!((planned.route.summary.length_m / 5022.0 - 1.0).abs() < 1e-3);
    let north = planned.distance.at(DVec2::new(100.0, 10.0)).unwrap();
    assert!((north / 10_027.1 - 1.0).abs() < 2e-3, "{north}");
}

#[test]
fn routes_begin_and_end_where_they_were_asked_to_and_know_their_length() {
    let terrain = square(N, heights(N));
    for metric in metrics() {
        let route = plan(&terrain, &metric, START, GOAL).route;
        assert_eq!(route.grid.first(), Some(&START));
        assert_eq!(route.grid.last(), Some(&GOAL));
        let sum: f64 = route.points.windows(2).map(|p| p[0].distance(p[1])).sum();
        assert!((sum / route.summary.length_m - 1.0).abs() < 1e-3);
        assert!(route.summary.plan_length_m < route.summary.length_m);
        let rise = route.points[route.points.len() - 1].z - route.points[0].z;
        assert!((route.summary.climb_m - route.summary.descent_m - rise).abs() < 1e-6);
    }
}

#[test]
fn a_goal_on_the_start_costs_nothing_and_every_route_there_is_best() {
    let terrain = square(N, heights(N));
    let control = Control::default();
    let surface = HeightSurface::fit(&terrain, &FitOptions::default(), &control).unwrap();
    let fields = metrics()
        .map(|metric| metric.on(&surface, &Modifiers::default(), &Control::default()).unwrap());
    let comparison =
        Comparison::between(Solver::default(), &fields, &[GOAL.into()], GOAL, &control).unwrap();
    for (m, costs) in comparison.costs.iter().enumerate() {
        for (r, &cost) in costs.iter().enumerate() {
            assert_eq!((cost, comparison.ratio(m, r)), (0.0, 1.0));
        }
    }
}

/// Costs of the routes to some goals relative to the exact distance minus 1, and how far they stray from the exact
/// line in cells. `flat` maps the ground to a plane where routes are straight and distance is length.
fn errors(
    kind: SyntheticKind,
    metric: &dyn Metric,
    goals: impl Iterator<Item = DVec2>,
    exact: impl Fn(DVec2, DVec2) -> f64,
    stray: impl Fn(DVec2, DVec2, DVec2) -> f64,
) -> (f64, f64) {
    let control = Control::default();
    let shape = Synthetic::new(kind, 401, 401, 1.0).unwrap();
    let terrain = shape.terrain(Crs::none(), DVec2::ZERO).unwrap();
    let interpolate = FitOptions { smoothing: Smoothing::Interpolate, ..FitOptions::default() };
    let surface = HeightSurface::fit(&terrain, &interpolate, &control).unwrap();
    let field = metric.on(&surface, &Modifiers::default(), &Control::default()).unwrap();
    let start = DVec2::new(-31.3, 20.4);
    let grid = |p: DVec2| terrain.frame().to_grid(p);
    let map =
        Solver::default().solve(&field, &[grid(start).into()], &Stop::Never, &control).unwrap();
    goals.fold((0.0, 0.0), |(cost, far), goal| {
        let route = trace(&map, &field, grid(goal)).unwrap();
        let error: f64 = route.summary.cost / exact(start, goal) - 1.0;
        let far = route.points.iter().map(|p| stray(start, goal, p.truncate())).fold(far, f64::max);
        (error.abs().max(cost), far)
    })
}

#[test]
fn routes_on_a_cylinder_and_a_sphere_are_exact() {
    let goals = || (0..24).map(|k| 120.0 * DVec2::from_angle(0.3 + TAU * f64::from(k) / 24.0));
    for delta in [None, Some(0.001)] {
        let metric: Box<dyn Metric> = match delta {
            None => Box::new(Isotropic),
            Some(d) => Box::new(Curvature { delta: Delta::Absolute(d) }),
        };
        let shape = |kind| Synthetic::new(kind, 401, 401, 1.0).unwrap().radius().unwrap();

        let radius = shape(SyntheticKind::Cylinder);
        let unrolled = |p: DVec2| DVec2::new(radius * (p.x / radius).asin(), p.y);
        let stray = |a: DVec2, b: DVec2, p: DVec2| {
            let along = (unrolled(b) - unrolled(a)).normalize();
            (unrolled(p) - unrolled(a)).perp_dot(along).abs()
        };
        let exact = |a, b| cylinder_distance(radius, delta, a, b);
        let (cost, far) = errors(SyntheticKind::Cylinder, &metric, goals(), exact, stray);
        assert!(cost < 1e-7 && far < 0.003, "cylinder, {metric:?}: {cost:e}, {far} cells");

        let radius = shape(SyntheticKind::Sphere);
        let lift = |p: DVec2| p.extend((radius * radius - p.length_squared()).sqrt());
        // Height over the plane of the great circle.
        let stray =
            |a: DVec2, b: DVec2, p: DVec2| lift(p).dot(lift(a).cross(lift(b)).normalize()).abs();
        let exact = |a, b| sphere_distance(radius, delta, a, b);
        let (cost, far) = errors(SyntheticKind::Sphere, &metric, goals(), exact, stray);
        assert!(cost < 1e-7 && far < 0.003, "sphere, {metric:?}: {cost:e}, {far} cells");
    }
}

#[test]
fn costs_of_the_ground_refract_like_light() {
    // A plane whose southern half costs three times as much: the way crosses the border where
    // sin α = 3 sin β (Snell), that is, where its cost is least.
    let n = 201;
    let plain = terrain(n, n, DVec2::ONE, vec![0.0; n * n]);
    let control = Control::default();
    let surface = HeightSurface::fit(&plain, &FitOptions::default(), &control).unwrap();
    let cost_at = |row: usize| if row < 100 { 1f32 } else { 3.0 };
    let cost = |from: fn(f32) -> f32| -> Modifiers {
        let cost = (0..n * n).map(|i| from(cost_at(i / n))).collect();
        Modifiers { cost: Some(cost), ..Modifiers::default() }
    };
    let solve = |modifiers: &Modifiers| {
        let field = Isotropic.on(&surface, modifiers, &Control::default()).unwrap();
        assert_eq!(field.unit(), if modifiers.cost.is_some() { Unit::Ag } else { Unit::Metres });
        let start = DVec2::new(30.0, 20.0);
        Solver::default().solve(&field, &[start.into()], &Stop::Never, &control).unwrap()
    };
    let map = solve(&cost(|cost| cost));
    for goal in [DVec2::new(30.0, 180.0), DVec2::new(150.0, 150.0), DVec2::new(190.0, 120.0)] {
        // The border lies between rows 99 and 100, to half a cell.
        let by = |x: f64| (x - 30.0).hypot(79.5) + 3.0 * (goal.x - x).hypot(goal.y - 99.5);
        let exact = (0..=2000).map(|i| by(0.1 * f64::from(i))).fold(f64::INFINITY, f64::min);
        let found = map.at(goal).unwrap();
        assert!((found / exact - 1.0).abs() < 8e-3, "{goal}: {found}, exactly {exact}");
    }
    let (uniform, none) = (solve(&cost(|_| 3.0)), solve(&Modifiers::default()));
    let ratio =
        uniform.at(DVec2::new(111.0, 77.5)).unwrap() / none.at(DVec2::new(111.0, 77.5)).unwrap();
    assert!((ratio - 3.0).abs() < 1e-4, "{ratio}");
    let half = solve(&cost(|cost| if cost > 1.0 { f32::NAN } else { cost }));
    assert!(half.at_node(100, 99).is_finite() && half.at_node(100, 100).is_infinite());
    assert!(Isotropic.on(&surface, &cost(|_| 0.0), &Control::default()).is_err());
    let short = Modifiers { cost: Some(vec![1.0; 5].into()), ..Modifiers::default() };
    assert!(Isotropic.on(&surface, &short, &Control::default()).is_err());
}
