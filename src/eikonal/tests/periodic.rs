//! Periodic grids: the parameters of cylinders, tori and spheres without poles.

use std::f64::consts::{FRAC_PI_2, PI};

use super::*;

/// Both accuracies.
const ACCURACIES: [Accuracy; 2] = [Accuracy::Fast, Accuracy::High];
/// Which directions are periodic: cylinders along either axis, and a torus.
const CLOSED: [[bool; 2]; 3] = [[true, false], [false, true], [true, true]];

fn closed(
    cols: usize,
    rows: usize,
    directions: [bool; 2],
    tensor: impl Fn(usize, usize) -> Option<Sym2> + Sync,
) -> TensorField {
    field(cols, rows, tensor).periodic(directions).unwrap()
}

fn solve_as(accuracy: Accuracy, field: TensorField, starts: &[StartRegion]) -> DistanceMap {
    let solver = Solver { accuracy, ..Solver::default() };
    solver.solve_field(field, starts, &Stop::Never, &Control::default()).unwrap()
}

/// The least of a length over the periodic images of an offset.
fn over_images(
    offset: DVec2,
    period: DVec2,
    [across, down]: [bool; 2],
    length: impl Fn(DVec2) -> f64,
) -> f64 {
    let periods = |periodic: bool| if periodic { -40..=40 } else { 0..=0 };
    let images = periods(down).flat_map(|j| periods(across).map(move |i| (i, j)));
    let lengths =
        images.map(|(i, j)| length(offset + period * DVec2::new(f64::from(i), f64::from(j))));
    lengths.fold(f64::INFINITY, f64::min)
}

/// A smooth tensor that has the periods of the grid.
fn wavy(cols: usize, rows: usize, ratio: f64) -> impl Fn(usize, usize) -> Option<Sym2> + Sync {
    move |c, r| {
        let (x, y) = (TAU * c as f64 / cols as f64, TAU * r as f64 / rows as f64);
        let share = (0.5 * (x + y).sin() + 0.5).powi(2);
        Some(rotated(1.0 + (ratio - 1.0) * share, x - 2.0 * y) * (2.0 + x.cos() * y.sin()))
    }
}

#[test]
fn the_distance_is_that_of_the_nearest_image() {
    let narrow = [(3, 50), (5, 70), (16, 60), (20, 90)];
    for (cols, rows) in [(17, 40), (33, 33), (50, 64), (100, 48)].into_iter().chain(narrow) {
        let period = DVec2::new(cols as f64, rows as f64);
        for directions in CLOSED {
            for (d, bounds) in [
                (IDENTITY, [(1e-2, 5e-3), (2e-3, 7e-4)]),
                (rotated(9.0, 0.4), [(4e-2, 2e-2), (2e-2, 6e-3)]),
            ] {
                let start = DVec2::new(0.3 * cols as f64, rows as f64 - 1.4);
                let exact = |c: usize, r: usize| {
                    let offset = DVec2::new(c as f64, r as f64) - start;
                    Some(over_images(offset, period, directions, |v| d.inverse().norm(v)))
                };
                for (accuracy, (most, mean)) in ACCURACIES.into_iter().zip(bounds) {
                    let f = closed(cols, rows, directions, |_, _| Some(d));
                    let map = solve_as(accuracy, f, &[start.into()]);
                    let errors = errors(&map, exact);
                    assert!(
                        errors.0 < most && errors.1 < mean,
                        "{cols} x {rows} {directions:?} {accuracy:?}: {errors:?}"
                    );
                }
            }
        }
    }
}

#[test]
fn an_unrolled_copy_has_the_same_distances() {
    for (cols, rows, ratio) in [(60, 60, 4.0), (49, 32, 9.0), (33, 20, 4.0)] {
        let tensor = wavy(cols, rows, ratio);
        let start = DVec2::new(1.3, rows as f64 - 2.8);
        let middle = start + DVec2::new(cols as f64, rows as f64);
        for accuracy in ACCURACIES {
            let map = solve_as(accuracy, closed(cols, rows, [true; 2], &tensor), &[start.into()]);
            let copy = field(3 * cols, 3 * rows, |c, r| tensor(c % cols, r % rows));
            let copy = solve_as(accuracy, copy, &[middle.into()]);
            let exact = |c: usize, r: usize| {
                let images = (0..9).map(|k| copy.at_node(c + k % 3 * cols, r + k / 3 * rows));
                images.min_by(f64::total_cmp)
            };
            // Factors reach farther on the larger grid; the scheme is the same but for that.
            let errors = errors(&map, exact);
            let most = if accuracy == Accuracy::Fast { 1e-2 } else { 2e-3 };
            assert!(errors.1 < most, "{cols} x {rows} {accuracy:?}: {errors:?}");
        }
    }
}

#[test]
fn a_shifted_start_shifts_the_map() {
    let (cols, rows) = (50, 37);
    let tensor = wavy(cols, rows, 4.0);
    let start = DVec2::new(20.3, 18.8);
    for accuracy in ACCURACIES {
        let plain = solve_as(accuracy, closed(cols, rows, [true; 2], &tensor), &[start.into()]);
        for (dx, dy) in [(20, 0), (30, 0), (0, 19), (31, 18), (48, 36)] {
            let shifted =
                |c: usize, r: usize| tensor((c + cols - dx) % cols, (r + rows - dy) % rows);
            let by = DVec2::new(dx as f64, dy as f64);
            let map =
                solve_as(accuracy, closed(cols, rows, [true; 2], shifted), &[(start + by).into()]);
            let exact = |c: usize, r: usize| {
                Some(plain.at_node((c + cols - dx) % cols, (r + rows - dy) % rows))
            };
            // Which factor applies is decided tile by tile, and the tiles are shifted relative to the start.
            let errors = errors(&map, exact);
            assert!(errors.0 < 5e-4 && errors.1 < 1e-5, "{by} {accuracy:?}: {errors:?}");
        }
    }
}

#[test]
fn distances_on_a_sphere_converge_over_the_seam() {
    // Longitude all around, latitude to 60°: D = diag(1/cos² φ, 1) in radians.
    let solve = |n: usize, accuracy: Accuracy| {
        let (rows, step) = (n / 3 + 1, TAU / n as f64);
        let latitude = |r: usize| (r as f64 - 0.5 * (rows - 1) as f64) * step;
        let tensor = |_, r| Some(Sym2::new(latitude(r).cos().powi(-2), 0.0, 1.0) * step.powi(-2));
        let start = DVec2::new(0.0, 0.5 * (rows - 1) as f64);
        let map = solve_as(accuracy, closed(n, rows, [true, false], tensor), &[start.into()]);
        // From the equator great circles do not leave the band for a quarter of a turn.
        let exact = |c: usize, r: usize| {
            let east = (c as f64 * step + PI).rem_euclid(TAU) - PI;
            let distance = (latitude(r).cos() * east.cos()).acos();
            (east.abs() < FRAC_PI_2).then_some(distance)
        };
        errors(&map, exact)
    };
    for (accuracy, bound, least) in [(Accuracy::Fast, 2e-3, 0.9), (Accuracy::High, 1e-5, 1.8)] {
        let [coarse, fine] = [120, 480].map(|n| solve(n, accuracy));
        let order = order(coarse.1, fine.1, 4.0);
        assert!(fine.1 < bound && order > least, "{accuracy:?} {coarse:?} {fine:?} {order}");
    }
}

#[test]
fn an_annulus_is_flat() {
    // Polar coordinates: D = diag(1/ρ², 1). Paths go straight, or around the hole of radius 1 along its border.
    let solve = |n: usize, accuracy: Accuracy| {
        let (rows, step) = (n / 6 + 1, TAU / n as f64);
        let radius = |r: f64| 1.0 + r * step;
        let tensor =
            |_, r: usize| Some(Sym2::new(radius(r as f64).powi(-2), 0.0, 1.0) * step.powi(-2));
        let start = DVec2::new(n as f64 - 1.3, 0.6 * rows as f64);
        let map = solve_as(accuracy, closed(n, rows, [true, false], tensor), &[start.into()]);
        let a = radius(start.y);
        let exact = |c: usize, r: usize| {
            let b = radius(r as f64);
            let turn = ((c as f64 - start.x) * step + PI).rem_euclid(TAU) - PI;
            let hidden = turn.abs() - a.recip().acos() - b.recip().acos();
            Some(match hidden > 0.0 {
                true => (a * a - 1.0).sqrt() + (b * b - 1.0).sqrt() + hidden,
                false => (a * a + b * b - 2.0 * a * b * turn.cos()).sqrt(),
            })
        };
        errors(&map, exact)
    };
    for (accuracy, bound, least) in [(Accuracy::Fast, 1e-3, 0.85), (Accuracy::High, 1e-4, 1.4)] {
        let [coarse, fine] = [120, 480].map(|n| solve(n, accuracy));
        let order = order(coarse.1, fine.1, 4.0);
        assert!(fine.1 < bound && order > least, "{accuracy:?} {coarse:?} {fine:?} {order}");
    }
}

#[test]
fn a_wall_along_the_seam_does_not_leak() {
    // With the wall a cylinder is a plane again.
    for (cols, wall) in [(33, 0), (33, 32), (48, 47), (50, 20), (5, 4)] {
        for straight in [true, false] {
            // A row of single nodes touching at their corners only.
            let closed_at = |c: usize, r: usize| {
                c == if straight { wall } else { (wall + r.min(39 - r)) % cols }
            };
            let open = |c: usize, r: usize| (!closed_at(c, r)).then_some(IDENTITY);
            let next = (wall + 1) % cols;
            let start = DVec2::new(next as f64, 0.0);
            let map =
                solve_as(Accuracy::High, closed(cols, 40, [true, false], open), &[start.into()]);
            let around = (cols - 2) as f64;
            let there = map.at_node((wall + cols - 1) % cols, 0);
            assert!(there > 0.99 * around, "{cols} {wall}: {there}");
            let beyond = DVec2::new(wall as f64 - 0.6, 0.0);
            assert!(map.at(beyond).is_some_and(|g| g > 0.9 * around), "{cols} {wall}");
        }
    }
}

#[test]
fn thread_count_changes_no_bit_around_the_seam() {
    for accuracy in ACCURACIES {
        let run = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let f = closed(161, 129, [true; 2], wavy(161, 129, 9.0));
            pool.install(|| solve_as(accuracy, f, &[DVec2::new(160.2, 3.9).into()]))
        };
        let one = run(1);
        for threads in [2, 4, 8] {
            let map = run(threads);
            assert_eq!(map.to_row_major(), one.to_row_major());
            assert_eq!(map.statistics(), one.statistics());
        }
    }
}

#[test]
fn points_a_period_apart_are_the_same() {
    let (cols, rows) = (50, 40);
    let start = DVec2::new(49.2, 20.4);
    let f = || closed(cols, rows, [true, false], wavy(cols, rows, 4.0));
    for accuracy in ACCURACIES {
        let map = solve_as(accuracy, f(), &[start.into()]);
        let same = solve_as(accuracy, f(), &[(start - 3.0 * DVec2::new(50.0, 0.0)).into()]);
        let difference = errors(&same, |c, r| Some(map.at_node(c, r))).0;
        assert!(difference < 1e-6, "{difference}");
        for k in 0..500 {
            let at = DVec2::new(0.37 * f64::from(k) - 60.0, (0.71 * f64::from(k)) % 39.0);
            let home = DVec2::new(at.x.rem_euclid(50.0), at.y);
            let close = |a: DVec2, b: DVec2| a.distance(b) < 1e-3;
            let (a, b) = (map.at(at).unwrap(), map.at(home).unwrap());
            assert!((a - b).abs() <= 1e-6 * b, "{at}: {a} {b}");
            assert!(close(map.gradient_at(at).unwrap(), map.gradient_at(home).unwrap()), "{at}");
            assert!(close(map.direction_at(at).unwrap(), map.direction_at(home).unwrap()), "{at}");
        }
        // No jump at the seam, and none where the coordinates are far away.
        for row in 0..39 {
            let at = |x: f64| map.at(DVec2::new(x, f64::from(row) + 0.3)).unwrap();
            let jump = (at(50.0 - 1e-6) - at(50.0 + 1e-6)).abs();
            assert!(jump < 1e-3, "{row}: {jump}");
            assert!((at(7.25) - at(7.25 + 50.0 * f64::from(1 << 20))).abs() < 1e-3);
        }
        assert_eq!(map.at(DVec2::new(1e300, 3.0)), None);
        assert_eq!(map.at(DVec2::new(10.0, -0.1)), None);
    }
}

#[test]
fn lines_and_areas_go_over_the_seam() {
    let f = || closed(60, 50, [true, true], |_, _| Some(IDENTITY));
    let ring = |x: f64, y: f64| {
        let ring = [[0.0, 0.0], [12.0, 0.0], [12.0, 9.0], [0.0, 9.0]];
        line(ring.map(|p| DVec2::from(p) + DVec2::new(x, y)))
    };
    let map = |start: StartRegion| solve_as(Accuracy::Fast, f(), &[start]);
    for (x, y) in [(54.0, 45.0), (-6.0, -5.0), (114.0, 45.0)] {
        let over = map(Polygon::new(ring(x, y), vec![]).into());
        let exact = |c: usize, r: usize| {
            let offset = DVec2::new(c as f64 - x, r as f64 - y) - DVec2::new(6.0, 4.5);
            let outside = |v: DVec2| (v.abs() - DVec2::new(6.0, 4.5)).max(DVec2::ZERO).length();
            Some(over_images(offset, DVec2::new(60.0, 50.0), [true; 2], outside))
        };
        let errors = errors(&over, exact);
        assert!(errors.0 < 1e-2 && errors.1 < 5e-3, "{errors:?}");
        assert_eq!((over.at_node(59, 49), over.at_node(2, 2)), (0.0, 0.0));
        assert_eq!(over.at(DVec2::new(60.7, -0.4)), Some(0.0));
    }
    // A line once around, and on.
    let helix = map(line([DVec2::new(10.0, 10.0), DVec2::new(130.0, 60.0)]).into());
    for (at, distance) in [((10, 10), 0.0), ((10, 35), 0.0), ((40, 22), 0.5), ((40, 35), 12.5)] {
        let exact = distance * 12.0 / 13.0;
        let found = helix.at_node(at.0, at.1);
        assert!((found - exact).abs() < 0.02, "{at:?}: {found} {exact}");
    }
}

#[test]
fn labels_stops_and_resuming_work_around_the_seam() {
    let (cols, rows) = (130, 100);
    let f = || closed(cols, rows, [true, true], wavy(cols, rows, 4.0));
    let starts = [(DVec2::new(128.7, 98.2), 0.0), (DVec2::new(60.2, 50.0), 3.0)];
    let whole = solve_from(f(), &starts, &Stop::Never);
    let labels = whole.allocation();
    assert!(labels.iter().all(Option::is_some));
    assert_eq!((labels[3], labels[99 * cols], labels[50 * cols + 60]), (Some(0), Some(0), Some(1)));
    let goal = DVec2::new(cols as f64 + 4.4, -3.2);
    for stop in [Stop::AllGoals(vec![goal]), Stop::AnyGoal(vec![goal]), Stop::Distance(9.0)] {
        let part = solve_from(f(), &starts, &stop);
        assert!(part.statistics().activations < whole.statistics().activations);
        assert!((part.at(goal).unwrap() - whole.at(goal).unwrap()).abs() < 1e-3);
        let on = Solver::default().resume(part, &Stop::Never, &Control::default()).unwrap();
        let (worst, _) = errors(&on, |c, r| Some(whole.at_node(c, r)));
        assert!(worst < 1e-4, "{stop:?}: {worst}");
    }
}

#[test]
fn an_edit_takes_effect_over_the_seam() {
    let start = DVec2::new(58.0, 40.0);
    for directions in CLOSED {
        let f = closed(60, 80, directions, wavy(60, 80, 25.0));
        let map = solve_as(Accuracy::Fast, f.clone(), &[start.into()]);
        let wall: Vec<_> = (0..30).map(|row| (1, 25 + row, None)).collect();
        let update =
            Solver::default().update_nodes(map, &wall, &Stop::Never, &Control::default()).unwrap();
        let mut edited = f;
        wall.iter().for_each(|&(col, row, tensor)| edited.set(col, row, tensor).unwrap());
        let fresh = solve_as(Accuracy::Fast, edited, &[start.into()]);
        let pairs = update.to_row_major().into_iter().zip(fresh.to_row_major());
        for (a, b) in pairs.filter(|(a, b)| a != b) {
            assert!((a - b).abs() < 1e-3 * b, "{directions:?}: {a} {b}");
        }
    }
}

#[test]
fn too_few_nodes_and_too_many_turns_are_errors() {
    for directions in CLOSED {
        let [cols, rows] = directions.map(|periodic| if periodic { 2 } else { 9 });
        assert!(field(cols, rows, |_, _| Some(IDENTITY)).periodic(directions).is_err());
        let [cols, rows] = directions.map(|periodic| if periodic { 3 } else { 1 });
        assert!(field(cols, rows, |_, _| Some(IDENTITY)).periodic(directions).is_ok());
    }
    let around = line([DVec2::ZERO, DVec2::new(1e9, 4.0)]).into();
    let f = closed(20, 20, [true, false], |_, _| Some(IDENTITY));
    let solved = Solver::default().solve_field(f, &[around], &Stop::Never, &Control::default());
    assert!(matches!(solved, Err(Error::Argument(_))));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(96))]

    #[test]
    fn agrees_with_the_reference_on_rough_closed_fields(
        (cols, rows) in proptest::sample::select(vec![(24, 37), (17, 16), (33, 18), (3, 40), (32, 5)]),
        tensors in proptest::collection::vec(any_tensor(), 24 * 37),
        directions in proptest::sample::select(CLOSED.to_vec()),
        (x, y) in (-50.0..50.0f64, 0.0..1.0f64),
        value in 0.0..20.0f64,
    ) {
        let start = |x: f64, y: f64| StartRegion::from(DVec2::new(
            if directions[0] { x } else { (x / 100.0 + 0.5) * (cols - 1) as f64 },
            y * (rows - 1) as f64,
        ));
        let f = closed(cols, rows, directions, |c, r| tensors[r * cols + c]);
        let starts = [start(x, y), start(-x, 1.0 - y).with_value(value)];
        let control = Control::default();
        let solver = Solver { tolerance: 0.0, ..Solver::default() };
        let fast = solver.solve_field(f.clone(), &starts, &Stop::Never, &control);
        let slow = reference::solve(f, &starts, &control);
        prop_assert_eq!(fast.is_ok(), slow.is_ok());
        let (Ok(fast), Ok(slow)) = (fast, slow) else { return Ok(()) };
        for row in 0..rows {
            for col in 0..cols {
                let (a, b) = (fast.at_node(col, row), slow.at_node(col, row));
                prop_assert!(a == b || (a - b).abs() <= 3e-5 * b, "({col}, {row}): {a} {b}");
            }
        }
    }
}
