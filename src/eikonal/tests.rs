//! The solver against closed forms and against the slow reference.

#[cfg(unix)]
mod file_store;
mod incremental;
mod periodic;

use std::f64::consts::TAU;
use std::sync::Mutex;

use geo_types::{LineString, MultiPoint, Polygon, Rect};
use glam::DVec2;
use proptest::prelude::*;
use rayon::prelude::*;

use super::*;
use crate::control::Control;
use crate::error::Error;
use crate::grid::Shapes;
use crate::linalg::Sym2;

const IDENTITY: Sym2 = Sym2::new(1.0, 0.0, 1.0);

fn rotated(ratio: f64, angle: f64) -> Sym2 {
    let along = DVec2::from_angle(angle);
    Sym2::outer(along) * ratio.sqrt() + Sym2::outer(along.perp()) * ratio.sqrt().recip()
}

fn field(
    cols: usize,
    rows: usize,
    tensor: impl Fn(usize, usize) -> Option<Sym2> + Sync,
) -> TensorField {
    TensorField::from_fn(cols, rows, tensor, &Control::default()).unwrap()
}

fn line(points: impl IntoIterator<Item = DVec2>) -> LineString<f64> {
    points.into_iter().map(|at| (at.x, at.y)).collect()
}

fn solve(field: TensorField, start: DVec2) -> DistanceMap {
    Solver::default()
        .solve_field(field, &[start.into()], &Stop::Never, &Control::default())
        .unwrap()
}

/// Without a tolerance, so that the order of the sweeps does not matter.
fn exactly(field: TensorField, start: DVec2) -> DistanceMap {
    let solver = Solver { tolerance: 0.0, ..Solver::default() };
    solver.solve_field(field, &[start.into()], &Stop::Never, &Control::default()).unwrap()
}

/// Largest and mean error over all nodes for which `exact` is known, relative to the largest and mean distance.
fn errors(map: &DistanceMap, exact: impl Fn(usize, usize) -> Option<f64>) -> (f64, f64) {
    let (mut worst, mut sum, mut largest, mut total) = (0f64, 0.0, 0f64, 0.0);
    for row in 0..map.rows() {
        for col in 0..map.cols() {
            if let Some(g) = exact(col, row) {
                let error = (map.at_node(col, row) - g).abs();
                worst = worst.max(error);
                sum += error;
                largest = largest.max(g);
                total += g;
            }
        }
    }
    (worst / largest, sum / total)
}

fn order(coarse: f64, fine: f64, refinement: f64) -> f64 {
    (coarse / fine).ln() / refinement.ln()
}

#[test]
fn constant_tensors_converge_to_the_norm() {
    // First order without the logarithm of h log h: source factoring removes the singularity.
    for (ratio, bound) in [(1.0, 2.5e-4), (4.0, 3e-4), (25.0, 6e-4), (100.0, 1e-3)] {
        let d = rotated(ratio, 0.5);
        let mean = [51, 101, 201, 401].map(|n| {
            let centre = DVec2::splat((n / 2) as f64);
            let map = solve(field(n, n, |_, _| Some(d)), centre);
            let exact = |c, r| Some(d.inverse().norm(DVec2::new(c as f64, r as f64) - centre));
            errors(&map, exact).1
        });
        assert!(mean[3] < bound, "ratio {ratio}: {mean:?}");
        let orders: Vec<f64> = mean.windows(2).map(|pair| order(pair[0], pair[1], 2.0)).collect();
        assert!(orders.iter().all(|&order| order > 0.97), "ratio {ratio}: {orders:?} in {mean:?}");
    }
}

#[test]
fn a_diffeomorphism_pulls_straight_lines_back() {
    // D = (ΦᵀΦ)⁻¹ with Φ = Dφ: distance is ‖φ(x) − φ(x0)‖. φ bends the unit square slightly.
    let phi = |p: DVec2| DVec2::new(p.x + 0.1 * (TAU * p.y).sin(), p.y + 0.1 * (TAU * p.x).sin());
    let mean = [101, 201, 401].map(|n| {
        let h = 1.0 / (n - 1) as f64;
        let at = |c: usize, r: usize| DVec2::new(c as f64, r as f64) * h - 0.5;
        let tensor = |c, r| {
            let p = at(c, r);
            let (a, b) = (0.1 * TAU * (TAU * p.y).cos(), 0.1 * TAU * (TAU * p.x).cos());
            Some(Sym2::new(1.0 + b * b, a + b, 1.0 + a * a).inverse() * (h * h).recip())
        };
        let map = solve(field(n, n, tensor), DVec2::splat((n / 2) as f64));
        // Inside this disc the segment to the centre stays in the image of the square.
        let exact = |c, r| Some(phi(at(c, r)).length()).filter(|&g| g < 0.35);
        errors(&map, exact).1
    });
    assert!(mean[2] < 6e-3 && order(mean[0], mean[2], 4.0) > 0.7, "{mean:?}");
}

#[test]
fn sheared_and_stretched_grids_see_the_same_distance() {
    // Speed 1 + x: the half-plane model of hyperbolic geometry, distance arcosh(1 + |p|²/(2(1+x))) from the origin.
    let exact = |p: DVec2| (1.0 + p.length_squared() / (2.0 * (1.0 + p.x))).acosh();
    for (across, down) in [
        (DVec2::new(1.0, 0.0), DVec2::new(0.0, 1.0)),
        (DVec2::new(1.0, 0.0), DVec2::new(0.6, 1.0)),
        (DVec2::new(0.5, 0.0), DVec2::new(0.0, 1.0)),
        (DVec2::new(0.9, -0.3), DVec2::new(0.4, 0.8)),
    ] {
        let error = [101, 201, 401].map(|n| {
            let h = 0.8 / (n - 1) as f64;
            let centre = DVec2::splat((n / 2) as f64);
            let at = |c: usize, r: usize| {
                let q = (DVec2::new(c as f64, r as f64) - centre) * h;
                across * q.x + down * q.y
            };
            // D in index coordinates: speed² A⁻¹A⁻ᵀ with the columns of A the steps of the grid, so M = AᵀA/speed².
            let gram = Sym2::new(across.length_squared(), across.dot(down), down.length_squared());
            let tensor = |c, r| Some((gram * (h / (1.0 + at(c, r).x)).powi(2)).inverse());
            let map = solve(field(n, n, tensor), centre);
            errors(&map, |c, r| Some(exact(at(c, r))).filter(|&g| g < 0.2)).1
        });
        assert!(
            error[2] < 4e-3 && order(error[0], error[2], 4.0) > 0.45,
            "{across} {down}: {error:?}"
        );
    }
}

#[test]
fn no_direction_is_favoured_on_a_plane() {
    let n = 441;
    let centre = DVec2::splat(220.0);
    let map = solve(field(n, n, |_, _| Some(IDENTITY)), centre);
    for k in 0..720 {
        let goal = centre + 200.0 * DVec2::from_angle(TAU * f64::from(k) / 720.0);
        let error = map.at(goal).unwrap() / 200.0 - 1.0;
        assert!(error.abs() < 4e-3, "{k}: {error}");
    }
}

#[test]
fn a_start_between_nodes_counts_from_itself() {
    let start = DVec2::new(50.3, 49.8);
    let map = solve(field(101, 101, |_, _| Some(IDENTITY)), start);
    let exact = |c, r| Some((DVec2::new(c as f64, r as f64) - start).length());
    assert!(errors(&map, exact).1 < 5e-3);
    assert!((map.at(DVec2::new(51.3, 49.8)).unwrap() - 1.0).abs() < 1e-6);
    assert_eq!(map.at(start), Some(0.0));
}

#[test]
fn lines_and_areas_are_start_regions() {
    let f = field(81, 61, |_, _| Some(rotated(4.0, 0.3)));
    let m = rotated(4.0, 0.3).inverse();
    // Distance to a straight line: |n·x| / √(nᵀ D n).
    let (a, b) = (DVec2::new(-200.0, 10.2), DVec2::new(300.0, 35.7));
    let map = Solver::default()
        .solve_field(f.clone(), &[line([a, b]).into()], &Stop::Never, &Control::default())
        .unwrap();
    let normal = (b - a).perp();
    let exact = |c, r| {
        let p = DVec2::new(c as f64, r as f64);
        // Farther out the nearest point of the line lies outside the grid.
        (20..60).contains(&c).then(|| (p - a).dot(normal).abs() / m.inverse().norm(normal))
    };
    let (_, mean) = errors(&map, exact);
    assert!(mean < 1e-4, "plane waves are exact up to rounding and tolerance: {mean}");

    let area = StartRegion::from(Rect::new((20.0, 20.0), (40.0, 40.0)));
    let map = Solver::default().solve_field(f, &[area], &Stop::Never, &Control::default()).unwrap();
    assert_eq!(map.at_node(30, 30), 0.0);
    assert!((map.at_node(30, 50) - 10.0 / m.inverse().norm(DVec2::Y)).abs() < 1e-3);
}

#[test]
fn an_outline_of_many_corners_is_as_good_a_start_as_a_circle() {
    let (n, centre, radius) = (201, DVec2::splat(100.0), 30.0);
    for corners in [500, 20_000] {
        let angle = |i: usize| TAU * i as f64 / corners as f64;
        let ring = line((0..corners).map(|i| centre + radius * DVec2::from_angle(angle(i))));
        let start = [Polygon::new(ring, vec![]).into()];
        let (f, control) = (field(n, n, |_, _| Some(IDENTITY)), Control::default());
        let map = Solver::default().solve_field(f, &start, &Stop::Never, &control).unwrap();
        let exact = |c: usize, r: usize| DVec2::new(c as f64, r as f64).distance(centre) - radius;
        let (worst, mean) = errors(&map, |c, r| Some(exact(c, r).max(0.0)));
        assert!(worst < 2e-2 && mean < 5e-3, "{corners}: {worst:e} {mean:e}");
    }
}

#[test]
fn a_ring_given_closed_is_the_same_start() {
    let open = [[30.0, 30.0], [50.0, 34.0], [44.0, 52.0]].map(DVec2::from);
    let closed = || line(open.into_iter().chain([open[0]]));
    let solve = |start: StartRegion| {
        let f = field(91, 91, |_, _| Some(rotated(4.0, 0.3)));
        let solver = Solver { tolerance: 0.0, ..Solver::default() };
        let map = solver.solve_field(f, &[start], &Stop::Never, &Control::default());
        map.unwrap().to_row_major()
    };
    let area = solve(Polygon::new(line(open), vec![]).into());
    assert_eq!(area, solve(Polygon::new(closed(), vec![]).into()));
    // Outside, a closed line is the border of its area.
    for (i, (line, area)) in solve(closed().into()).into_iter().zip(area).enumerate() {
        assert!(area == 0.0 || (line - area).abs() < 1e-6 * area, "{i}: {line} {area}");
    }
}

#[test]
fn a_diagonal_wall_of_single_nodes_does_not_leak() {
    for falling in [false, true] {
        let wall = |c: usize, r: usize| if falling { c + r == 40 } else { c == r };
        let map =
            solve(field(41, 41, |c, r| (!wall(c, r)).then_some(IDENTITY)), DVec2::new(20.0, 4.0));
        let beyond = if falling { (30, 30) } else { (4, 30) };
        assert!(map.at_node(beyond.0, beyond.1).is_infinite());
        assert!(map.at(DVec2::new(beyond.0 as f64 + 0.5, 30.5)).is_none());
    }
}

#[test]
fn goals_end_the_solve_early_with_final_values() {
    let tensor = |c: usize, r: usize| Some(rotated(9.0, (c + 2 * r) as f64 * 0.01));
    let f = field(301, 301, tensor);
    let (start, goal) = ([StartRegion::from(DVec2::splat(40.0))], DVec2::new(70.4, 61.7));
    let whole = Solver::default()
        .solve_field(f.clone(), &start, &Stop::Never, &Control::default())
        .unwrap();
    let stop = Stop::AllGoals(vec![goal]);
    let part = Solver::default().solve_field(f, &start, &stop, &Control::default()).unwrap();
    assert!(part.statistics().activations * 3 < whole.statistics().activations);
    assert_eq!(part.at(goal), whole.at(goal));
}

#[test]
fn the_default_tolerance_moves_no_value_noticeably() {
    for ratio in [1.0, 20.0, 100.0] {
        let tensor = |c: usize, r: usize| {
            let (x, y) = (c as f64 * 0.05, r as f64 * 0.04);
            Some(
                rotated(1.0 + (ratio - 1.0) * (x.sin() * y.cos()).powi(2), x + y)
                    * (2.0 + (x * y).sin()),
            )
        };
        let (loose, exact) =
            [solve, exactly].map(|run| run(field(300, 260, tensor), DVec2::splat(130.0))).into();
        let (largest, _) = errors(&loose, |c, r| Some(exact.at_node(c, r)));
        assert!(largest < 3e-5, "ratio {ratio}: {largest}");
    }
}

#[test]
fn no_value_next_to_crowded_starts_is_too_low() {
    for ratio in [1.0, 10.0, 100.0, 400.0] {
        for spacing in [1.5, 3.4, 9.0, 27.0] {
            let d = rotated(ratio, 0.4);
            let at = |i: usize, n: usize| {
                let jitter = DVec2::new((i * 37 % 11) as f64, (i * 53 % 7) as f64) * 0.1;
                DVec2::new((i % n) as f64, (i / n) as f64) * spacing + jitter + 3.0
            };
            let n = (110.0 / spacing) as usize;
            let points: Vec<DVec2> =
                (0..(n * n).min(150)).map(|i| at(i * 7 % (n * n), n)).collect();
            let starts: Vec<StartRegion> = points.iter().map(|&at| at.into()).collect();
            let f = field(120, 120, |_, _| Some(d));
            let map = Solver::default()
                .solve_field(f, &starts, &Stop::Never, &Control::default())
                .unwrap();
            for (i, value) in map.to_row_major().into_iter().enumerate() {
                let node = DVec2::new((i % 120) as f64, (i / 120) as f64);
                let exact = points.iter().map(|&at| d.inverse().norm(node - at));
                let exact = exact.fold(f64::INFINITY, f64::min);
                let low = exact - f64::from(value);
                // Between two fronts that meet, linear interpolation is too low by a small part of a step.
                let most = if ratio == 1.0 { 0.12 } else { f64::INFINITY };
                assert!(low < most, "{ratio} {spacing} {node}: {value} {exact}");
                assert!(value >= 0.0, "{ratio} {spacing} {node}: {value} {exact}");
            }
        }
    }
}

#[test]
fn thread_count_changes_no_bit() {
    let tensor = |c: usize, r: usize| {
        let void = (c / 9 + r / 7).is_multiple_of(5) && c % 9 < 6;
        (!void).then(|| rotated(1.0 + (c % 50) as f64, r as f64 * 0.1) * (1.0 + (r % 30) as f64))
    };
    let run = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| solve(field(333, 257, tensor), DVec2::new(160.2, 120.9)))
    };
    let one = run(1);
    for threads in [2, 4, 8] {
        let map = run(threads);
        assert_eq!(map.values, one.values);
        assert_eq!(map.statistics(), one.statistics());
    }
}

/// The threads of a pool work on each other's solves, and none waits for one that is busy with its own.
#[test]
fn solves_at_the_same_time_are_as_alone() {
    let start = |i: usize| DVec2::new(20.0 + 15.0 * i as f64, 90.5);
    // Large enough to yield to each other.
    let f = field(450, 450, |c, r| Some(rotated(9.0, 0.01 * (c + 2 * r) as f64)));
    let alone: Vec<_> = (0..8).map(|i| solve(f.clone(), start(i)).values).collect();
    for threads in [1, 2, 3] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let together: Vec<_> = pool.install(|| {
            (0..8).into_par_iter().map(|i| solve(f.clone(), start(i)).values).collect()
        });
        assert_eq!(together, alone);
    }
}

/// Begins three large solves and a small one at once; returns the numbers of their columns in the order in which they end.
fn race(begin: impl Fn(&[&(dyn Fn() + Sync)])) -> Vec<usize> {
    let tensor = |c: usize, r: usize| Some(rotated(9.0, 0.01 * (c + 2 * r) as f64));
    let (large, small) = (field(700, 700, tensor), field(70, 70, tensor));
    let over = Mutex::new(Vec::new());
    let run = |field: &TensorField| {
        solve(field.clone(), DVec2::splat(33.3));
        over.lock().unwrap().push(field.cols());
    };
    let (large, small) = (|| run(&large), || run(&small));
    begin(&[&large, &large, &large, &small]);
    over.into_inner().unwrap()
}

#[test]
fn a_small_solve_is_over_before_large_ones_that_begin_with_it() {
    for threads in [1, 2] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let in_the_pool = |solves: &[&(dyn Fn() + Sync)]| {
            pool.in_place_scope(|scope| {
                solves.iter().for_each(|&solve| scope.spawn(move |_| solve()));
            });
        };
        assert_eq!(race(in_the_pool), [70, 700, 700, 700]);
    }
    let outside = |solves: &[&(dyn Fn() + Sync)]| {
        std::thread::scope(|scope| solves.iter().for_each(|&solve| drop(scope.spawn(solve))));
    };
    assert_eq!(race(outside), [70, 700, 700, 700]);
}

#[test]
fn cancelling_one_of_several_solves_does_not_disturb_the_others() {
    let f = field(450, 450, |c, r| Some(rotated(9.0, 0.01 * (c + 2 * r) as f64)));
    let start = [StartRegion::from(DVec2::new(20.0, 90.5))];
    let solve =
        |control: &Control| Solver::default().solve_field(f.clone(), &start, &Stop::Never, control);
    let alone = solve(&Control::default()).unwrap().values;
    let pool = rayon::ThreadPoolBuilder::new().num_threads(2).build().unwrap();
    pool.install(|| {
        (0..8).into_par_iter().for_each(|i| {
            let control = Control::default();
            if i % 2 == 0 {
                return assert_eq!(solve(&control).unwrap().values, alone);
            }
            let cancel = control.cancel.clone();
            let progress = move |_: &str, done: f64| {
                if done > 0.2 {
                    cancel.cancel();
                }
            };
            let control = Control { progress: Some(std::sync::Arc::new(progress)), ..control };
            assert!(matches!(solve(&control), Err(Error::Cancelled)));
        });
    });
}

#[test]
fn a_uniform_scale_of_the_tensor_scales_every_value_exactly() {
    let d = |c: usize, r: usize| Some(rotated(9.0, 0.01 * (c * r) as f64));
    let one = exactly(field(90, 70, d), DVec2::new(30.0, 20.0));
    for scale in [1e-12, 1.0 / 3.0, 1e10] {
        let map = exactly(field(90, 70, |c, r| d(c, r).map(|d| d * scale)), DVec2::new(30.0, 20.0));
        let ratio = map.at_node(80, 60) / one.at_node(80, 60) * f64::sqrt(scale);
        assert!((ratio - 1.0).abs() < 1e-5, "{scale}: {ratio}");
    }
}

#[test]
fn hopeless_starts_and_cancelling_are_errors() {
    let f = || field(9, 9, |c, _| (c != 4).then_some(IDENTITY));
    let control = Control::default();
    let start = |at: DVec2| StartRegion::from(at);
    let run = |start: StartRegion, control: &Control| {
        Solver::default().solve_field(f(), &[start], &Stop::Never, control)
    };
    assert!(run(start(DVec2::new(4.0, 4.0)), &control).is_err());
    assert!(run(start(DVec2::new(50.0, 4.0)), &control).is_err());
    assert!(run(start(DVec2::NAN), &control).is_err());
    assert!(run(StartRegion::default(), &control).is_err());
    control.cancel.cancel();
    assert!(matches!(run(start(DVec2::ONE), &control), Err(Error::Cancelled)));
    let part = solve_from(f(), &[(DVec2::ONE, 0.0)], &Stop::Distance(2.0));
    let on = Solver::default().resume(part, &Stop::Never, &control);
    assert!(matches!(on, Err(Error::Cancelled)));
}

#[test]
fn cancelling_in_the_middle_leaves_nothing() {
    let control = Control::default();
    let cancel = control.cancel.clone();
    let progress = move |_: &str, done: f64| {
        if done > 0.2 {
            cancel.cancel();
        }
    };
    let f = rough(300, 300);
    let control = Control { progress: Some(std::sync::Arc::new(progress)), ..control };
    let start = [StartRegion::from(DVec2::new(8.0, 9.0))];
    let map = Solver::default().solve_field(f, &start, &Stop::Never, &control);
    assert!(matches!(map, Err(Error::Cancelled)));
}

/// A map from several starts, each with its value.
fn solve_from(field: TensorField, starts: &[(DVec2, f64)], stop: &Stop) -> DistanceMap {
    let starts: Vec<_> =
        starts.iter().map(|&(at, value)| StartRegion::from(at).with_value(value)).collect();
    Solver::default().solve_field(field, &starts, stop, &Control::default()).unwrap()
}

#[test]
fn the_nearest_start_wins_its_value_included() {
    // Additively weighted Voronoi regions of a constant tensor; the last start has no region, as others are nearer even there.
    let starts = [
        (DVec2::new(30.3, 40.8), 0.0),
        (DVec2::new(120.0, 35.2), 12.5),
        (DVec2::new(80.5, 110.0), 3.25),
        (DVec2::new(60.0, 60.0), 1e4),
    ];
    for d in [IDENTITY * 1e-4, rotated(9.0, 0.6)] {
        let distance = |c: usize, r: usize, (at, value): (DVec2, f64)| {
            value + d.inverse().norm(DVec2::new(c as f64, r as f64) - at)
        };
        let map = solve_from(field(151, 141, |_, _| Some(d)), &starts, &Stop::Never);
        let exact = |c, r| starts.iter().map(|&start| distance(c, r, start)).min_by(f64::total_cmp);
        let (worst, mean) = errors(&map, exact);
        assert!(worst < 5e-3 && mean < 2e-3, "{worst} {mean}");
        let diagonals = [DVec2::ONE, DVec2::new(1.0, -1.0)];
        let cell = diagonals.map(|v| d.inverse().norm(v)).into_iter().fold(0.0, f64::max);
        let labels = map.allocation();
        for (i, label) in labels.into_iter().enumerate() {
            let (c, r) = (i % 151, i / 151);
            let label = label.unwrap() as usize;
            let lost = distance(c, r, starts[label]) - exact(c, r).unwrap();
            assert!(label < 3 && lost < cell, "({c}, {r}): {label} is {lost} too far");
        }
    }
}

#[test]
fn one_list_of_starts_is_one_region_of_all() {
    let f = || field(90, 70, |c, r| Some(rotated(1.0 + (c % 30) as f64, 0.05 * r as f64)));
    let points = [DVec2::new(10.2, 60.0), DVec2::new(70.0, 20.9), DVec2::new(44.0, 33.3)];
    let one: MultiPoint<f64> = points.iter().map(|at| (at.x, at.y)).collect();
    let control = Control::default();
    let one = Solver::default().solve_field(f(), &[one.into()], &Stop::Never, &control).unwrap();
    let three = solve_from(f(), &points.map(|at| (at, 0.0)), &Stop::Never);
    assert_eq!(one.values, three.values);
    assert!(one.allocation().iter().all(|&label| label == Some(0)));
}

#[test]
fn a_start_value_adds_to_every_distance() {
    let d = |c: usize, r: usize| Some(rotated(9.0, 0.01 * (c * r) as f64) * 1e6);
    let at = DVec2::new(30.3, 20.0);
    let plain = solve_from(field(90, 70, d), &[(at, 0.0)], &Stop::Never);
    let later = solve_from(field(90, 70, d), &[(at, 0.01)], &Stop::Never);
    let (worst, _) = errors(&later, |c, r| Some(plain.at_node(c, r) + 0.01));
    assert!(worst < 1e-4, "{worst}");
    assert!((later.at(at).unwrap() - 0.01).abs() < 1e-12);
}

/// A rough field with walls.
fn rough(cols: usize, rows: usize) -> TensorField {
    field(cols, rows, |c, r| {
        let wall = (c / 9 + r / 7).is_multiple_of(5) && c % 9 < 6;
        (!wall)
            .then(|| rotated(1.0 + (c % 50) as f64, r as f64 * 0.1) * (1.0 + 0.1 * (r % 30) as f64))
    })
}

/// The nodes of `part` that are reached have the value they have in `whole`; returns how many.
fn assert_part(part: &DistanceMap, whole: &DistanceMap) -> usize {
    let nodes = (0..part.rows()).flat_map(|row| (0..part.cols()).map(move |col| (col, row)));
    let reached = nodes.filter(|&(c, r)| part.is_reached(c, r));
    let check = |(c, r)| {
        let (a, b) = (part.at_node(c, r), whole.at_node(c, r));
        assert!((a - b).abs() <= 1e-4 * b, "({c}, {r}): {a} {b}");
    };
    reached.map(check).count()
}

#[test]
fn what_a_stopped_solve_reports_is_final() {
    let start = [(DVec2::new(100.0, 90.0), 0.0)];
    let whole = solve_from(rough(260, 240), &start, &Stop::Never);
    let goals = vec![DVec2::new(130.5, 120.0), DVec2::new(60.2, 90.9)];
    let far = DVec2::new(250.0, 230.0);
    for stop in [
        Stop::AllGoals(goals.clone()),
        Stop::AnyGoal(vec![far, goals[0]]),
        Stop::Distance(20.0),
        Stop::Nodes(5000),
    ] {
        let part = solve_from(rough(260, 240), &start, &stop);
        assert!(part.statistics().activations * 2 < whole.statistics().activations, "{stop:?}");
        let reached = assert_part(&part, &whole);
        match stop {
            Stop::AllGoals(goals) => assert!(goals.iter().all(|&goal| part.at(goal).is_some())),
            Stop::AnyGoal(_) => assert!(part.at(goals[0]).is_some() && part.at(far).is_none()),
            Stop::Distance(d) => {
                let within = whole.to_row_major().iter().filter(|&&g| g <= d as f32).count();
                assert!(reached.abs_diff(within) <= 2, "{reached} {within}");
            }
            Stop::Nodes(count) => assert!(reached >= count && reached < 3 * count, "{reached}"),
            Stop::Never => unreachable!(),
        }
        let on = Solver::default().resume(part, &Stop::Never, &Control::default()).unwrap();
        assert!(on.statistics().activations < whole.statistics().activations);
        let (same, all) = (assert_part(&on, &whole), assert_part(&whole, &on));
        assert_eq!(same, all);
    }
}

#[test]
fn stops_that_nothing_meets_solve_everything() {
    let start = [(DVec2::new(8.0, 9.0), 0.0)];
    let whole = solve_from(rough(60, 40), &start, &Stop::Never);
    // Outside, behind a wall, beyond all.
    let closed = DVec2::new(0.0, 0.0);
    assert!(!whole.is_reached(0, 0));
    for stop in [
        Stop::AnyGoal(vec![DVec2::splat(1e9), closed]),
        Stop::AnyGoal(vec![]),
        Stop::AllGoals(vec![]),
        Stop::Distance(f64::INFINITY),
        Stop::Nodes(usize::MAX),
    ] {
        let part = solve_from(rough(60, 40), &start, &stop);
        assert_eq!(part.values, whole.values, "{stop:?}");
    }
    let nowhere = solve_from(rough(60, 40), &start, &Stop::Distance(0.0));
    assert_eq!((assert_part(&nowhere, &whole), nowhere.at_node(8, 9)), (1, 0.0));
}

#[test]
fn numbers_out_of_range_are_refused() {
    const OPEN: DVec2 = DVec2::new(8.0, 10.0);
    let run = |start: StartRegion, stop: &Stop| {
        let good = StartRegion::from(DVec2::new(8.0, 9.0));
        Solver::default().solve_field(rough(20, 20), &[good, start], stop, &Control::default())
    };
    let at = |at: DVec2| StartRegion::from(at);
    for value in [f64::NAN, f64::INFINITY, -1.0] {
        assert!(run(at(OPEN).with_value(value), &Stop::Never).is_err());
    }
    for bad in [at(DVec2::NAN), at(DVec2::INFINITY), line([OPEN, DVec2::NAN]).into()] {
        assert!(run(bad, &Stop::Never).is_err());
    }
    for d in [f64::NAN, -1.0] {
        assert!(run(at(OPEN), &Stop::Distance(d)).is_err());
    }
    assert!(run(at(OPEN), &Stop::Never).is_ok());
    assert!(
        run(at(DVec2::splat(1e300)), &Stop::Never).is_ok(),
        "one start out of sight is no error"
    );
}

/// A usual number, or now and then one of the kind that breaks programs.
fn any_number(usual: std::ops::Range<f64>) -> impl Strategy<Value = f64> {
    let rare = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 0.0, -1.0, 1e-300, 1e300, 1e18];
    prop_oneof![50 => usual, 1 => proptest::sample::select(rare.to_vec())]
}

/// A tensor of ratio up to 1e6 at very different speeds, one that is none, or a wall.
fn wild_tensor() -> impl Strategy<Value = Option<Sym2>> {
    prop_oneof![
        1 => Just(None),
        8 => (0.0..1e6f64.ln(), 0.0..TAU, -8.0..8f64)
            .prop_map(|(ratio, angle, speed)| Some(rotated(ratio.exp(), angle) * speed.exp())),
        1 => (any_number(-1.0..2.0), any_number(-1.0..1.0), any_number(-1.0..2.0))
            .prop_map(|(xx, xy, yy)| Some(Sym2::new(xx, xy, yy))),
    ]
}

/// A start inside, at the border or outside of a grid of `cols × rows`, of any kind and with any value.
fn wild_start(cols: usize, rows: usize) -> impl Strategy<Value = StartRegion> {
    let coordinate = |count: usize| {
        let last = (count as f64 - 1.0).max(0.1);
        prop_oneof![3 => any_number(-3.0..last + 3.0), 1 => Just(last), 1 => Just(0.0)]
    };
    let point = (coordinate(cols), coordinate(rows)).prop_map(|(x, y)| DVec2::new(x, y));
    let points = proptest::collection::vec(point, 0..4);
    (proptest::collection::vec(points, 3), any_number(0.0..9.0), any::<bool>()).prop_map(
        |(mut lines, value, point)| {
            let points = lines.pop().unwrap_or_default();
            let mut shapes = Shapes { points, ..Shapes::default() };
            let mut lines = lines.drain(..).map(line);
            shapes.lines.extend(lines.next());
            if point {
                shapes.lines.extend(lines);
                return shapes.into();
            }
            let exterior = lines.next().unwrap_or_else(LineString::empty);
            shapes.polygons.push(Polygon::new(exterior, lines.collect()));
            StartRegion::from(shapes).with_value(value)
        },
    )
}

fn wild_problem() -> impl Strategy<Value = (usize, usize, Vec<Option<Sym2>>, Vec<StartRegion>)> {
    let sizes =
        [(1, 1), (1, 40), (33, 1), (17, 1), (2, 2), (17, 17), (16, 33), (40, 25), (3, 30), (0, 3)];
    proptest::sample::select(sizes.to_vec()).prop_flat_map(|(cols, rows)| {
        let tensors = proptest::collection::vec(wild_tensor(), cols * rows);
        let starts = proptest::collection::vec(wild_start(cols, rows), 0..4);
        (Just(cols), Just(rows), tensors, starts)
    })
}

fn any_stop() -> impl Strategy<Value = Stop> {
    let goals = || {
        let goal = (any_number(-2.0..40.0), any_number(-2.0..40.0));
        proptest::collection::vec(goal.prop_map(|(x, y)| DVec2::new(x, y)), 0..3)
    };
    prop_oneof![
        Just(Stop::Never),
        goals().prop_map(Stop::AllGoals),
        goals().prop_map(Stop::AnyGoal),
        any_number(0.0..20.0).prop_map(Stop::Distance),
        (0..2000usize).prop_map(Stop::Nodes),
    ]
}

/// A tensor of ratio up to 100, or a wall.
fn any_tensor() -> impl Strategy<Value = Option<Sym2>> {
    prop_oneof![
        1 => Just(None),
        5 => (0.0..100f64.ln(), 0.0..TAU, -2.0..2f64)
            .prop_map(|(ratio, angle, speed)| Some(rotated(ratio.exp(), angle) * speed.exp())),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(128))]

    #[test]
    fn agrees_with_the_reference_on_rough_fields(
        tensors in proptest::collection::vec(any_tensor(), 24 * 37),
        (x, y) in (0.0..23.0f64, 0.0..36.0f64),
        (value, other) in (0.0..20.0f64, 0.0..23.0f64),
    ) {
        let f = field(24, 37, |c, r| tensors[r * 24 + c]);
        let second = StartRegion::from(DVec2::new(other, x)).with_value(value);
        let start = [StartRegion::from(DVec2::new(x, y)), second];
        let control = Control::default();
        let solver = Solver { tolerance: 0.0, ..Solver::default() };
        let fast = solver.solve_field(f.clone(), &start, &Stop::Never, &control);
        let Ok(fast) = fast else {
            prop_assert!(!f.is_open(x.round() as usize, y.round() as usize));
            return Ok(());
        };
        let slow = reference::solve(f, &start, &control).unwrap();
        for row in 0..37 {
            for col in 0..24 {
                let (a, b) = (fast.at_node(col, row), slow.at_node(col, row));
                prop_assert!(a == b || (a - b).abs() <= 3e-5 * b, "({col}, {row}): {a} {b}");
            }
        }
    }

    #[test]
    fn an_early_end_changes_no_goal(
        tensors in proptest::collection::vec(any_tensor(), 60 * 50),
        (x, y) in (0.0..59.0f64, 0.0..49.0f64),
        goal in (0.0..59.0f64, 0.0..49.0f64),
    ) {
        let f = field(60, 50, |c, r| tensors[r * 60 + c]);
        let start = [StartRegion::from(DVec2::new(x, y))];
        let goal = DVec2::from(goal);
        let solver = Solver { tolerance: 0.0, ..Solver::default() };
        let control = Control::default();
        if let Ok(whole) = solver.solve_field(f.clone(), &start, &Stop::Never, &control) {
            let part = solver.solve_field(f, &start, &Stop::AllGoals(vec![goal]), &control).unwrap();
            match (part.at(goal), whole.at(goal)) {
                // Some units in the last place of the `f32` of a node.
                (Some(a), Some(b)) => prop_assert!((a - b).abs() <= 1e-6 * b, "{a} {b}"),
                (a, b) => prop_assert_eq!(a, b),
            }
        }
    }

    #[test]
    fn wild_input_gives_an_answer_or_an_error(
        (cols, rows, tensors, starts) in wild_problem(),
        stop in any_stop(),
        at in (any_number(-1.0..40.0), any_number(-1.0..40.0)),
        accuracy in prop_oneof![Just(Accuracy::Fast), Just(Accuracy::High)],
        periodic in any::<[bool; 2]>(),
    ) {
        let control = Control::default();
        let of = |kept: &(dyn Fn(&Sym2) -> bool + Sync)| {
            TensorField::from_fn(cols, rows, |c, r| tensors[r * cols + c].filter(kept), &control)
        };
        // Refused tensors become walls, so that the others are solved.
        let kept = |d: &Sym2| [d.xx, d.yy, d.det()].iter().all(|x| (1e-8..1e8).contains(x));
        let Ok(f) = of(&|_| true).or_else(|_| of(&kept)) else { return Ok(()) };
        let f = f.periodic([periodic[0] && cols > 2, periodic[1] && rows > 2]).unwrap();
        let solver = Solver { accuracy, ..Solver::default() };
        let Ok(map) = solver.solve_field(f, &starts, &stop, &control) else { return Ok(()) };
        for (i, g) in map.to_row_major().into_iter().enumerate() {
            prop_assert!(g >= 0.0, "{g}");
            prop_assert!(g.is_infinite() || map.field.is_open(i % cols, i / cols));
            let _ = map.direction(i % cols, i / cols);
        }
        prop_assert!(map.at(DVec2::from(at)).is_none_or(|g| g >= 0.0));
        for (label, g) in map.allocation().into_iter().zip(map.to_row_major()) {
            prop_assert!(label.is_none_or(|label| (label as usize) < starts.len() && g.is_finite()));
        }
        let on = solver.resume(map, &Stop::Never, &control);
        prop_assert!(on.is_err() || on.is_ok_and(|on| on.to_row_major().iter().all(|g| *g >= 0.0)));
    }

    #[test]
    fn stopped_and_resumed_is_solved_in_one_go(
        tensors in proptest::collection::vec(any_tensor(), 60 * 50),
        (x, y) in (0.0..59.0f64, 0.0..49.0f64),
        share in 0.0..1.0f64,
    ) {
        let f = field(60, 50, |c, r| tensors[r * 60 + c]);
        let start = [
            StartRegion::from(DVec2::new(x, y)),
            StartRegion::from(DVec2::new(y, x.min(49.0))).with_value(share),
        ];
        let solver = Solver { tolerance: 0.0, ..Solver::default() };
        let control = Control::default();
        if let Ok(whole) = solver.solve_field(f.clone(), &start, &Stop::Never, &control) {
            let largest = whole.to_row_major().into_iter().filter(|g| g.is_finite()).fold(0.0, f32::max);
            let stop = Stop::Distance(share * f64::from(largest));
            let part = solver.solve_field(f, &start, &stop, &control).unwrap();
            let near = |map: &DistanceMap, most: f64| {
                let mut worst = 0f64;
                for row in 0..50 {
                    for col in 0..60 {
                        let (a, b) = (map.at_node(col, row), whole.at_node(col, row));
                        if a != b && (b < most || a.is_finite()) {
                            worst = worst.max((a - b).abs() / b);
                        }
                    }
                }
                worst
            };
            let Stop::Distance(most) = stop else { unreachable!() };
            prop_assert!(near(&part, most * (1.0 - 1e-5)) <= 1e-5);
            let labels = part.allocation();
            for (i, label) in labels.into_iter().enumerate() {
                prop_assert_eq!(label.is_some(), part.is_reached(i % 60, i / 60));
            }
            let on = solver.resume(part, &Stop::Never, &control).unwrap();
            prop_assert!(near(&on, f64::INFINITY) <= 1e-5);
        }
    }

    #[test]
    fn mirrors_and_transposes_with_its_field(
        tensors in proptest::collection::vec(any_tensor(), 20 * 20),
    ) {
        let at = |c: usize, r: usize| if (c, r) == (9, 11) { Some(IDENTITY) } else { tensors[r * 20 + c] };
        let plain = exactly(field(20, 20, at), DVec2::new(9.0, 11.0));
        let transposed = |d: Sym2| Sym2::new(d.yy, d.xy, d.xx);
        let swapped = exactly(field(20, 20, |c, r| at(r, c).map(transposed)), DVec2::new(11.0, 9.0));
        let flipped = |d: Sym2| Sym2::new(d.xx, -d.xy, d.yy);
        let mirrored = exactly(field(20, 20, |c, r| at(19 - c, r).map(flipped)), DVec2::new(10.0, 11.0));
        for row in 0..20 {
            for col in 0..20 {
                let g = plain.at_node(col, row);
                for other in [swapped.at_node(row, col), mirrored.at_node(19 - col, row)] {
                    prop_assert!(g == other || (g - other).abs() <= 1e-4 * g, "({col}, {row}): {g} {other}");
                }
            }
        }
    }
}
