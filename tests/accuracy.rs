//! Every accuracy of the solver, on every number of threads, against closed forms: how large the error is, with which
//! order it falls, and whether the solver's own estimate of it is honest.

#[path = "../examples/solve_problem/exact.rs"]
mod exact;
#[path = "../benches/problems/mod.rs"]
mod problems;

use glam::DVec2;
use problems::{ACCURACIES, Problem, solver};
use ridgeway::{Control, DistanceMap, Stop};

const FAST: &str = ACCURACIES[0];
const HIGH: &str = ACCURACIES[1];

fn solve(problem: Problem, n: usize, accuracy: &str) -> DistanceMap {
    let control = Control::default();
    let field = problem.field(n, &control).unwrap();
    let solver = solver(accuracy).unwrap();
    solver.solve_field(field, &Problem::start(n), &Stop::Never, &control).unwrap()
}

/// Exact distances of the nodes more than three cells from the start, which is in the middle.
fn judged(problem: Problem, n: usize) -> Vec<(usize, usize, f64)> {
    let exact = exact::exact(problem).expect("a problem with a closed form");
    let middle = (n / 2) as f64;
    let nodes = (0..n).flat_map(|row| (0..n).map(move |col| (col, row)));
    nodes
        .filter_map(|(col, row)| {
            let step = DVec2::new(col as f64 - middle, row as f64 - middle);
            let far = step.abs().max_element() > 3.0;
            Some((col, row, exact(step / (n - 1) as f64).filter(|_| far)?))
        })
        .collect()
}

/// Mean and largest relative error.
fn errors(map: &DistanceMap, truth: &[(usize, usize, f64)]) -> [f64; 2] {
    let errors = truth.iter().map(|&(col, row, g)| (map.at_node(col, row) / g - 1.0).abs());
    let (sum, largest) = errors.fold((0.0, 0f64), |(s, l), error| (s + error, l.max(error)));
    [sum / truth.len() as f64, largest]
}

const SMOOTH: [Problem; 4] =
    [Problem::Diffeomorphism, Problem::LinearSpeed, Problem::Cylinder, Problem::SphereCap];

#[test]
fn errors_fall_with_the_order_of_the_accuracy() {
    for problem in SMOOTH {
        for (accuracy, least) in [(FAST, [0.9, 0.8]), (HIGH, [1.9, 0.95])] {
            let [coarse, fine] =
                [101, 401].map(|n| errors(&solve(problem, n, accuracy), &judged(problem, n)));
            for k in 0..2 {
                let order = (coarse[k] / fine[k]).log(4.0);
                assert!(
                    order > least[k],
                    "{problem:?} {accuracy:?} {k}: {order} of {coarse:?} {fine:?}"
                );
            }
        }
    }
}

#[test]
fn errors_are_small_at_any_ratio() {
    // Mean and largest relative error at 401², near the start included.
    let bounds = [
        (1.0, [2.5e-4, 5e-4], [6e-7, 2e-5]),
        (4.0, [3e-4, 1.8e-3], [8e-7, 2e-5]),
        (25.0, [7e-4, 1e-2], [3e-6, 8e-5]),
        (100.0, [1.5e-3, 4e-2], [1e-5, 6e-4]),
        (400.0, [3e-3, 1.4e-1], [9e-5, 8e-3]),
    ];
    for (ratio, fast, high) in bounds {
        let problem = Problem::Constant { ratio };
        let truth = judged(problem, 401);
        for (accuracy, bound) in [(FAST, fast), (HIGH, high)] {
            let error = errors(&solve(problem, 401, accuracy), &truth);
            assert!(error[0] < bound[0] && error[1] < bound[1], "{ratio} {accuracy:?}: {error:?}");
        }
    }
}

#[test]
fn the_estimate_of_the_error_is_honest() {
    // For 95 % of the nodes the error is below three times the estimate; where there is no closed form, against a
    // solution four times finer.
    let constant = [1.0, 4.0, 25.0, 100.0, 400.0].map(|ratio| Problem::Constant { ratio });
    let rough = [Problem::Hills, Problem::RandomSpeed, Problem::Rotating];
    for problem in constant.into_iter().chain(SMOOTH).chain(rough) {
        let n = 201;
        let map = solve(problem, n, HIGH);
        let truth = match exact::exact(problem) {
            Some(_) => judged(problem, n),
            None => finer(problem, n),
        };
        let honest = truth.iter().filter(|&&(col, row, g)| {
            (map.at_node(col, row) - g).abs() < 3.0 * map.error_at_node(col, row).unwrap()
        });
        let share = honest.count() as f64 / truth.len() as f64;
        assert!(share > 0.95, "{problem:?}: {share}");
        let fast = errors(&solve(problem, n, FAST), &truth)[0];
        let high = errors(&map, &truth)[0];
        assert!(high < 0.5 * fast, "{problem:?}: {high} against {fast}");
    }
}

fn finer(problem: Problem, n: usize) -> Vec<(usize, usize, f64)> {
    let map = solve(problem, 4 * (n - 1) + 1, HIGH);
    let middle = n / 2;
    let nodes = (0..n).flat_map(|row| (0..n).map(move |col| (col, row)));
    nodes
        .filter(|&(col, row)| col.abs_diff(middle).max(row.abs_diff(middle)) > 3)
        .map(|(col, row)| (col, row, map.at_node(4 * col, 4 * row)))
        .collect()
}

#[test]
fn no_accuracy_depends_on_the_number_of_threads() {
    for problem in [Problem::Hills, Problem::Rotating, Problem::Maze] {
        for accuracy in [FAST, HIGH] {
            let run = |threads| {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
                let map = pool.install(|| solve(problem, 201, accuracy));
                map.to_row_major().into_iter().map(f32::to_bits).collect::<Vec<_>>()
            };
            let one = run(1);
            for threads in [2, 4, 8] {
                assert!(run(threads) == one, "{problem:?} {accuracy:?} on {threads} threads");
            }
        }
    }
}

#[test]
fn corrections_reach_every_node_beside_walls() {
    for problem in [Problem::Maze, Problem::Spiral] {
        let (fast, high) = (solve(problem, 301, FAST), solve(problem, 301, HIGH));
        for (fast, high) in fast.to_row_major().into_iter().zip(high.to_row_major()) {
            assert!(fast.is_finite() == high.is_finite(), "{problem:?}: {fast} {high}");
            // Ways in a maze are long; the first-order error of a plane wave is below a percent.
            assert!(
                !fast.is_finite() || (fast - high).abs() <= 0.05 * fast,
                "{problem:?}: {fast} {high}"
            );
        }
    }
}

#[test]
fn values_gradients_and_directions_between_nodes_are_as_good_as_at_nodes() {
    let problem = Problem::Constant { ratio: 4.0 };
    let exact = exact::exact(problem).expect("a closed form");
    let n = 201;
    let map = solve(problem, n, HIGH);
    let h = 1.0 / (n - 1) as f64;
    for k in 0..500 {
        let turn = f64::from(k);
        let by = DVec2::from_angle(turn) * (6.0 + 0.18 * turn);
        let at = DVec2::splat(100.0) + by;
        let truth = exact(by * h).unwrap();
        let value = map.at(at).unwrap();
        // At the nodes it is 4.1e-5 at most.
        assert!((value / truth - 1.0).abs() < 5e-5, "{by}: {value} {truth}");
        // A bare field has no frame: gradients are per cell, y upwards.
        let gradient = map.gradient_at(at).unwrap();
        let slope = |step: DVec2| {
            (exact((by + step) * h).unwrap() - exact((by - step) * h).unwrap()) / 0.02
        };
        let expected = DVec2::new(slope(0.01 * DVec2::X), -slope(0.01 * DVec2::Y));
        assert!(
            gradient.distance(expected) < 2e-3 * expected.length(),
            "{by}: {gradient} {expected}"
        );
        // On a constant tensor one travels straight away from the start.
        let direction = map.direction_at(at).unwrap();
        assert!(
            direction.distance(DVec2::new(by.x, -by.y).normalize()) < 5e-3,
            "{by}: {direction}"
        );
    }
}
