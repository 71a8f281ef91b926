//! Polished lines against closed forms and finer grids.

use std::f64::consts::TAU;

use super::*;
use crate::control::Control;
use crate::eikonal::{DistanceMap, Solver, Stop, TensorField, has_line_of_sight};
use crate::route::descent;

const IDENTITY: Sym2 = Sym2::new(1.0, 0.0, 1.0);

/// The distance on the nodes of an `n × n` grid under a metric that is known everywhere.
fn solve(n: usize, start: DVec2, metric: impl Fn(DVec2) -> Option<Sym2> + Sync) -> DistanceMap {
    let tensor = |c, r| Some(metric(DVec2::new(c as f64, r as f64))?.inverse());
    let field = TensorField::from_fn(n, n, tensor, &Control::default()).unwrap();
    Solver::default()
        .solve_field(field, &[start.into()], &Stop::Never, &Control::default())
        .unwrap()
}

fn cost(line: &[DVec2], metric: impl Fn(DVec2) -> Sym2) -> f64 {
    length_along(line, |at, by| metric(at).norm(by))
}

fn polished(
    distance: &DistanceMap,
    goal: DVec2,
    metric: impl Fn(DVec2) -> Sym2,
) -> [Vec<DVec2>; 2] {
    let last = DVec2::splat((distance.cols() - 1) as f64);
    let inside = |p: DVec2| p.cmpge(DVec2::ZERO).all() && p.cmple(last).all();
    let clear = |a, b| inside(a) && inside(b) && has_line_of_sight(&distance.field, a, b);
    let line = descent::line(distance, goal).unwrap();
    let polished = polish(&line, &metric, &clear);
    assert_eq!((polished[0], polished[polished.len() - 1]), (line[0], goal));
    assert!(cost(&polished, &metric) <= cost(&line, &metric));
    assert!(polished.windows(2).all(|ends| clear(ends[0], ends[1])));
    [line, polished]
}

#[test]
fn lines_on_a_constant_metric_become_straight() {
    for ratio in [1.0, 4.0, 25.0, 100.0, 400.0] {
        let along = DVec2::from_angle(0.5);
        let metric = Sym2::outer(along) + Sym2::outer(along.perp()) * ratio;
        let start = DVec2::new(100.3, 99.6);
        let distance = solve(201, start, |_| Some(metric));
        for k in 0..40 {
            let goal = start + 95.0 * DVec2::from_angle(0.157 * f64::from(k));
            let [_, line] = polished(&distance, goal, |_| metric);
            let across = (goal - start).normalize();
            let stray = line.iter().map(|p| (*p - start).perp_dot(across).abs());
            let stray = stray.fold(0.0, f64::max);
            assert!(stray < 5e-3, "ratio {ratio}, goal {goal}: {stray} cells");
            let error = cost(&line, |_| metric) / metric.norm(goal - start) - 1.0;
            assert!(error.abs() < 1e-6, "ratio {ratio}, goal {goal}: {error}");
        }
    }
}

#[test]
fn a_diffeomorphism_pulls_straight_lines_back() {
    // M = ΦᵀΦ with Φ = Dφ: distance is ‖φ(x) − φ(x0)‖ and routes are the preimages of straight lines.
    let phi = |p: DVec2| p + 0.1 * DVec2::new((TAU * p.y).sin(), (TAU * p.x).sin());
    let n = 401;
    let h = 1.0 / (n - 1) as f64;
    let at = |p: DVec2| p * h - 0.5;
    let metric = |p: DVec2| {
        let p = at(p);
        let (a, b) = (0.1 * TAU * (TAU * p.y).cos(), 0.1 * TAU * (TAU * p.x).cos());
        Sym2::new(1.0 + b * b, a + b, 1.0 + a * a) * (h * h)
    };
    let start = DVec2::splat((n / 2) as f64);
    let distance = solve(n, start, |p| Some(metric(p)));
    for k in 0..40 {
        let goal = start + 0.3 / h * DVec2::from_angle(TAU * f64::from(k) / 40.0);
        let [_, line] = polished(&distance, goal, metric);
        let end = phi(at(goal));
        let stray = line.iter().map(|&p| phi(at(p)).perp_dot(end.normalize()).abs() / h);
        let stray = stray.fold(0.0, f64::max);
        let error = cost(&line, metric) / end.length() - 1.0;
        assert!(stray < 0.01 && error.abs() < 1e-6, "goal {goal}: {stray} cells, {error}");
    }
}

#[test]
fn lines_round_a_wall_are_taut() {
    // A wall with a square end: the shortest path touches the corners of the cells of its last nodes.
    let (start, goal) = (DVec2::new(60.0, 20.2), DVec2::new(65.0, 100.7));
    let wall = |p: DVec2| p.x <= 80.0 && (p.y - 60.0).abs() <= 2.0;
    let distance = solve(121, start, |p| (!wall(p)).then_some(IDENTITY));
    let corners = [DVec2::new(80.5, 57.5), DVec2::new(80.5, 62.5)];
    let exact = cost(&[start, corners[0], corners[1], goal], |_| IDENTITY);
    let lines = polished(&distance, goal, |_| IDENTITY);
    let [traced, polished] = lines.map(|line| cost(&line, |_| IDENTITY) / exact - 1.0);
    assert!(traced > 3e-3 && polished < 8e-4, "{traced} {polished}");
}

#[test]
fn lines_keep_out_of_rough_walls() {
    // Random metric and random walls; `polished` looks at every segment.
    let random = |p: DVec2, salt: f64| {
        ((p.x * 12.9898 + p.y * 78.233 + salt).sin() * 43758.5453).rem_euclid(1.0)
    };
    let metric = |p: DVec2| {
        let along = DVec2::from_angle(0.1 * p.x + (0.13 * p.y).sin());
        Sym2::outer(along)
            + Sym2::outer(along.perp()) * (2.0 + (0.3 * p.x).sin() + (0.2 * p.y).cos())
    };
    let start = DVec2::splat(40.0);
    let distance = solve(81, start, |p| (random(p, 0.5) > 0.2 || p == start).then(|| metric(p)));
    for k in 0..200 {
        let goal = DVec2::new(f64::from(k % 20), f64::from(k / 20) * 2.0) * 4.0;
        if distance.stored_at(goal).is_some() {
            polished(&distance, goal, metric);
        }
    }
}

/// Isotropic costs at the nodes, bilinear between them.
fn bilinear(node: impl Fn(i64, i64) -> f64, at: DVec2) -> Sym2 {
    let (first, f) = (at.floor(), at - at.floor());
    let node = |i: i64, j: i64| node(first.x as i64 + i, first.y as i64 + j);
    let row = |j| (1.0 - f.x) * node(0, j) + f.x * node(1, j);
    IDENTITY * ((1.0 - f.y) * row(0) + f.y * row(1)).powi(2)
}

#[test]
fn lines_into_costly_ground_are_refracted() {
    // Layers c(x): with the invariant p of Snell's law a line goes ∫ p/√(c² − p²) dx aside and costs ∫ c²/√(c² − p²) dx.
    // Cheap ground of cost 1, a ramp of one cell, and costly ground.
    let layers = |p: f64, cheap: f64, costly: f64, ratio: f64| {
        let root = |c: f64| (c * c - p * p).sqrt();
        let log = |c: f64| (c + root(c)).ln();
        let cost = |c: f64| 0.5 * (c * root(c) + p * p * log(c));
        let ramp = (ratio - 1.0).recip();
        let aside = p * (cheap / root(1.0) + ramp * (log(ratio) - log(1.0)) + costly / root(ratio));
        let cost = cheap / root(1.0)
            + ramp * (cost(ratio) - cost(1.0))
            + ratio * ratio * costly / root(ratio);
        (aside, cost)
    };
    for ratio in [10.0, 50.0, 1000.0] {
        let metric = |p| bilinear(|c, _| if c <= 50 { 1.0 } else { ratio }, p);
        let (start, goal) = (DVec2::new(10.0, 20.0), DVec2::new(61.0, 90.0));
        let distance = solve(101, start, |p| Some(metric(p)));
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..60 {
            let p = 0.5 * (low + high);
            let short = layers(p, 40.0, 10.0, ratio).0 < goal.y - start.y;
            (low, high) = if short { (p, high) } else { (low, p) };
        }
        let exact = layers(low, 40.0, 10.0, ratio).1;
        let [_, line] = polished(&distance, goal, metric);
        let error = cost(&line, metric) / exact - 1.0;
        assert!(error.abs() < 2e-3, "1 : {ratio}: {error}");
    }
}

#[test]
fn lines_go_around_a_costly_block() {
    // A string around the cheap nodes next to the block; the corners of the ramp save it a trifle.
    let (start, goal) = (DVec2::new(60.0, 20.0), DVec2::new(62.0, 100.0));
    for ratio in [50.0, 1000.0] {
        let block = |c: i64, r: i64| (40..=80).contains(&c) && (50..=70).contains(&r);
        let metric = |p| bilinear(|c, r| if block(c, r) { ratio } else { 1.0 }, p);
        let distance = solve(121, start, |p| Some(metric(p)));
        let corners = [DVec2::new(81.0, 49.0), DVec2::new(81.0, 71.0)];
        let exact = cost(&[start, corners[0], corners[1], goal], |_| IDENTITY);
        let [_, line] = polished(&distance, goal, metric);
        let error = cost(&line, metric) / exact - 1.0;
        assert!((-2e-3..5e-3).contains(&error), "1 : {ratio}: {error}");
    }
}

#[test]
fn lines_keep_to_the_cheap_between_random_patches() {
    let random = |c: i64, r: i64| {
        let mut x = (c as u64) << 32 ^ (r as u64) << 8 ^ 7;
        for _ in 0..3 {
            x = (x ^ x >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            x ^= x >> 27;
        }
        x >> 63 == 0
    };
    let node = |c: i64, r: i64| if random(c.div_euclid(8), r.div_euclid(8)) { 50.0 } else { 1.0 };
    let metric = |p| bilinear(node, p);
    let mut sum = 0.0;
    for (start, goal) in [
        (DVec2::new(8.0, 8.0), DVec2::new(120.0, 117.0)),
        (DVec2::new(10.0, 100.0), DVec2::new(118.0, 20.0)),
        (DVec2::new(5.0, 60.0), DVec2::new(123.0, 66.0)),
        (DVec2::new(64.0, 4.0), DVec2::new(60.0, 124.0)),
    ] {
        let distance = solve(129, start, |p| Some(metric(p)));
        // The truth within 1 %, by a quarter of the cell.
        let fine = solve(513, start * 4.0, |p| Some(metric(p * 0.25) * 0.0625));
        let [_, line] = polished(&distance, goal, metric);
        let cost = cost(&line, metric);
        let ratios = [cost / fine.at(goal * 4.0).unwrap(), cost / distance.at(goal).unwrap()];
        assert!(ratios[0] < 1.1 && ratios[1] < 1.22, "{goal}: {ratios:?}");
        sum += ratios[0];
    }
    assert!(sum / 4.0 < 1.05, "{}", sum / 4.0);
}

#[test]
fn nothing_is_asked_of_lines_and_metrics_that_have_nothing() {
    let anywhere = |_: DVec2, _: DVec2| true;
    let points = [DVec2::ZERO, DVec2::ONE, DVec2::new(2.0, 1.0), DVec2::new(2.0, 1.0)];
    for count in 0..=points.len() {
        let line = polish(&points[..count], &|_| IDENTITY, &anywhere);
        assert_eq!(line.first(), points[..count].first());
        assert_eq!(line.last(), points[..count].last());
    }
    for bad in [0.0, f64::NAN, f64::INFINITY] {
        assert_eq!(polish(&points, &|_| IDENTITY * bad, &anywhere), refine(&points));
    }
    assert_eq!(polish(&points, &|_| IDENTITY, &|_, _| false), refine(&points));
}

#[test]
fn polishing_keeps_to_a_road_one_cell_wide() {
    for dear in [2.0, 10.0, 50.0, 1000.0] {
        // A road along row 5 and then down column 19, bilinear between the nodes.
        let node = |c: i32, r: i32| {
            let on_road = (r == 5 && (3..20).contains(&c)) || (c == 19 && (5..27).contains(&r));
            if on_road { 1.0 } else { dear }
        };
        let cost = |at: DVec2| {
            let (cell, t) = (at.floor(), at - at.floor());
            let (c, r) = (cell.x as i32, cell.y as i32);
            let row = |r| node(c, r) * (1.0 - t.x) + node(c + 1, r) * t.x;
            row(r) * (1.0 - t.y) + row(r + 1) * t.y
        };
        let metric = |at: DVec2| Sym2::new(1.0, 0.0, 1.0) * cost(at).powi(2);
        let along = (3..19).map(|c| DVec2::new(f64::from(c), 5.0));
        let line: Vec<DVec2> =
            along.chain((5..27).map(|r| DVec2::new(19.0, f64::from(r)))).collect();
        let length = fine_length(&polish(&line, &metric, &|_, _| true), &metric);
        assert!(length <= 37.0 * (1.0 + 1e-9), "1:{dear}: {length}");
    }
}
