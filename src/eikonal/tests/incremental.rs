//! Updates after an edit against solves from the beginning.

use super::*;

type Edits = Vec<(usize, usize, Option<Sym2>)>;

/// The largest relative difference between an update and a solve from the beginning, beyond the errors that both admit in high
/// accuracy; infinite if one reaches what the other does not.
fn difference(update: &DistanceMap, fresh: &DistanceMap) -> f64 {
    let difference = |(col, row): (usize, usize)| {
        let (a, b) = (update.at_node(col, row), fresh.at_node(col, row));
        let error = |map: &DistanceMap| map.error_at_node(col, row).unwrap_or(0.0);
        if a == b { 0.0 } else { ((a - b).abs() - error(update) - error(fresh)) / b }
    };
    let nodes = (0..fresh.rows()).flat_map(|row| (0..fresh.cols()).map(move |col| (col, row)));
    nodes.map(difference).map(|d| if d.is_nan() { f64::INFINITY } else { d }).fold(0.0, f64::max)
}

/// The map of a field with some nodes edited, updated and from the beginning.
fn both(
    solver: &Solver,
    field: &TensorField,
    starts: &[StartRegion],
    edits: &Edits,
    stop: &Stop,
) -> Option<[DistanceMap; 2]> {
    let control = Control::default();
    let map = solver.solve_field(field.clone(), starts, stop, &control).ok()?;
    let update = solver.update_nodes(map, edits, &Stop::Never, &control);
    let mut field = field.clone();
    for &(col, row, tensor) in edits {
        field.set(col, row, tensor).unwrap();
    }
    let fresh = solver.solve_field(field, starts, &Stop::Never, &control);
    match (update, fresh) {
        (Ok(update), Ok(fresh)) => Some([update, fresh]),
        (Err(_), Err(_)) => None,
        (update, _) => panic!("only one is an error; the update {}", update.is_err()),
    }
}

/// A closed line of nodes.
fn wall(from: (usize, usize), step: (usize, usize), count: usize) -> Edits {
    (0..count).map(|i| (from.0 + i * step.0, from.1 + i * step.1, None)).collect()
}

/// A field that is smooth, rough or a maze, and may be uniform around the start.
fn any_field() -> impl Strategy<Value = TensorField> {
    let rough = proptest::collection::vec(any_tensor(), 60 * 50);
    let rough = rough.prop_map(|tensors| field(60, 50, |c, r| tensors[r * 60 + c]));
    let smooth = (0.0..100f64.ln(), 0.0..TAU, 0.0..0.1f64).prop_map(|(ratio, angle, turn)| {
        field(60, 50, |c, r| Some(rotated(ratio.exp(), angle + turn * (c + 2 * r) as f64)))
    });
    let maze = (2..6usize, 3..9usize, any::<u64>()).prop_map(|(width, gap, seed)| {
        field(60, 50, |c, r| {
            let wall = c % (width + 1) == width
                && !(r + (seed >> (c % 32)) as usize % 64).is_multiple_of(gap + 8);
            (!wall).then_some(rotated(4.0, 0.3))
        })
    });
    prop_oneof![rough, smooth, maze]
}

/// Nodes closed, opened or changed, one by one or as walls.
fn any_edits() -> impl Strategy<Value = Edits> {
    let node = (0..60usize, 0..50usize, any_tensor());
    let nodes = proptest::collection::vec(node, 0..30);
    let walls = (0..20usize, 0..20usize, 0..2usize, 0..2usize, 1..30usize)
        .prop_map(|(col, row, x, y, count)| wall((col, row), (x, y), count));
    let opened = (0..30usize, 0..20usize, 1..30usize).prop_map(|(col, row, count)| {
        wall((col, row), (1, 1), count)
            .into_iter()
            .map(|(c, r, _)| (c, r, Some(IDENTITY)))
            .collect()
    });
    prop_oneof![nodes, walls, opened]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(256))]

    #[test]
    fn an_update_is_a_solve_from_the_beginning(
        f in any_field(),
        edits in any_edits(),
        (x, y) in (0.0..59.0f64, 0.0..49.0f64),
        (other, value) in (0.0..49.0f64, 0.0..20.0f64),
        exact in any::<bool>(),
        accuracy in prop_oneof![Just(Accuracy::Fast), Just(Accuracy::High)],
        stop in prop_oneof![3 => Just(Stop::Never), 1 => (0.0..40.0f64).prop_map(Stop::Distance)],
    ) {
        let second = StartRegion::from(DVec2::new(other, x.min(49.0))).with_value(value);
        let starts = [StartRegion::from(DVec2::new(x, y)), second];
        let tolerance = if exact { 0.0 } else { Solver::default().tolerance };
        let solver = Solver { tolerance, accuracy };
        if let Some([update, fresh]) = both(&solver, &f, &starts, &edits, &stop) {
            let bound = if exact { 1e-5 } else { 1e-3 };
            let difference = difference(&update, &fresh);
            prop_assert!(difference <= bound, "{difference:e}");
        }
    }
}

/// A field whose direction of greatest speed turns, three times as fast along it as across.
fn turning(n: usize) -> TensorField {
    field(n, n, |c, r| Some(rotated(9.0, 4.0 * (c + 2 * r) as f64 / n as f64)))
}

fn update_one(field: &TensorField, start: DVec2, edits: &Edits) -> [DistanceMap; 2] {
    let [update, fresh] =
        both(&Solver::default(), field, &[start.into()], edits, &Stop::Never).unwrap();
    let difference = difference(&update, &fresh);
    assert!(difference < 1e-3, "{difference:e}");
    [update, fresh]
}

#[test]
fn only_what_an_edit_affects_is_solved_again() {
    let (f, start) = (turning(501), DVec2::splat(250.0));
    let [update, fresh] = update_one(&f, start, &wall((460, 225), (0, 1), 50));
    let (some, all) = (update.statistics(), fresh.statistics());
    assert!(some.activations * 10 < all.activations, "{some:?} {all:?}");
    assert!(some.sweeps * 10 < all.sweeps, "{some:?} {all:?}");
    // The same again changes nothing.
    let closed = wall((460, 225), (0, 1), 50);
    let again =
        Solver::default().update_nodes(update.clone(), &closed, &Stop::Never, &Control::default());
    let again = again.unwrap();
    assert!(difference(&again, &update) < 1e-4);
    assert!(again.statistics().activations < 100, "{:?}", again.statistics());
    // A node behind all others: the only value that changes is its own.
    let [update, _] = update_one(&f, start, &vec![(0, 500, None)]);
    assert!(update.statistics().activations < 10, "{:?}", update.statistics());
}

#[test]
fn what_a_wall_cuts_off_is_unreached_until_it_is_opened() {
    let (f, start) = (rough(130, 110), DVec2::new(8.0, 9.0));
    let whole = solve_from(f.clone(), &[(start, 0.0)], &Stop::Never);
    let [update, _] = update_one(&f, start, &wall((70, 0), (0, 1), 110));
    assert!(whole.is_reached(100, 50) && !update.is_reached(100, 50) && update.is_reached(60, 50));
    let opened =
        (0..110).map(|row| (70, row, f.metric(70, row).map(Sym2::inverse))).collect::<Vec<_>>();
    let scale = f.root_scale().powi(2);
    let opened: Vec<_> = opened.into_iter().map(|(c, r, d)| (c, r, d.map(|d| d * scale))).collect();
    let again = Solver::default().update_nodes(update, &opened, &Stop::Never, &Control::default());
    let difference = difference(&again.unwrap(), &whole);
    assert!(difference < 1e-3, "{difference:e}");
}

#[test]
fn edits_at_the_start_move_it_or_leave_none() {
    let (f, start) = (turning(90), DVec2::new(40.3, 50.8));
    update_one(&f, start, &wall((41, 40), (0, 1), 20));
    update_one(&f, start, &vec![(40, 51, Some(IDENTITY * 30.0))]);
    let around: Edits =
        (38..44).flat_map(|col| (48..54).map(move |row| (col, row, None))).collect();
    let map = solve_from(f, &[(start, 0.0)], &Stop::Never);
    let buried = Solver::default().update_nodes(map, &around, &Stop::Never, &Control::default());
    assert!(buried.is_err());
}

#[test]
fn what_a_stop_masked_supports_nothing() {
    // Obtuse: some nodes have their value from a segment of which one end is farther than they are, even beyond the stop;
    // what cuts off that end cuts off them.
    let f = field(60, 50, |c, r| Some(rotated(80.0, 0.3 + 0.1 * (c + 2 * r) as f64)));
    let start = DVec2::new(20.0, 18.4);
    let whole = solve_from(f.clone(), &[(start, 0.0)], &Stop::Never);
    for distance in [10.0, 14.0] {
        let beyond =
            |&(col, row): &_| (distance..distance + 0.6).contains(&whole.at_node(col, row));
        let nodes = (0..50).flat_map(|row| (0..60).map(move |col| (col, row)));
        for (col, row) in nodes.filter(beyond) {
            let (stop, edit) = (Stop::Distance(distance), vec![(col, row, None)]);
            let [update, fresh] =
                both(&Solver::default(), &f, &[start.into()], &edit, &stop).unwrap();
            let difference = difference(&update, &fresh);
            assert!(difference < 2e-3, "{distance}: {difference:e}");
        }
    }
}

#[test]
fn whole_fields_are_compared_and_other_shapes_solved() {
    let (solver, control) = (Solver::default(), Control::default());
    let (f, start) = (turning(120), DVec2::new(30.0, 60.0));
    let map = solve_from(f.clone(), &[(start, 0.0)], &Stop::Never);
    let mut edited = f;
    for row in 20..90 {
        edited.set(70, row, None).unwrap();
    }
    for other in [edited, turning(150), field(120, 120, |_, _| Some(IDENTITY * 1e6))] {
        let fresh = solve_from(other.clone(), &[(start, 0.0)], &Stop::Never);
        let update = solver.update_field(map.clone(), other, &Stop::Never, &control).unwrap();
        let difference = difference(&update, &fresh);
        assert!(difference < 1e-3, "{difference:e}");
    }
    let outside = solver.update_nodes(map, &[(120, 0, None)], &Stop::Never, &control);
    assert!(outside.is_err());
}

#[test]
fn a_correction_follows_edits_and_resuming() {
    let solver = Solver { accuracy: Accuracy::High, ..Solver::default() };
    let (f, start) = (turning(200), [DVec2::new(30.0, 60.0).into()]);
    let control = Control::default();
    let worst = |map: &DistanceMap, other: &DistanceMap| {
        let pairs = map.to_row_major().into_iter().zip(other.to_row_major());
        pairs.map(|(a, b)| if a == b { 0.0 } else { (a - b).abs() / b }).fold(0.0, f32::max)
    };
    let edits = wall((70, 20), (0, 1), 60);
    let [update, fresh] = both(&solver, &f, &start, &edits, &Stop::Never).unwrap();
    assert!(worst(&update, &fresh) < 1e-4, "{:e}", worst(&update, &fresh));
    let tensor =
        update.field.metric(90, 100).unwrap().inverse() * update.field.root_scale().powi(2);
    let same = [(90, 100, Some(tensor))];
    let again = solver.update_nodes(update.clone(), &same, &Stop::Never, &control).unwrap();
    assert!(worst(&again, &update) < 3e-6, "{:e}", worst(&again, &update));
    let whole = solver.solve_field(f.clone(), &start, &Stop::Never, &control).unwrap();
    let part = solver.solve_field(f.clone(), &start, &Stop::Distance(60.0), &control).unwrap();
    assert!(!part.is_reached(190, 100));
    let on = solver.resume(part.clone(), &Stop::Never, &control).unwrap();
    assert!(worst(&on, &whole) < 1e-5, "{:e}", worst(&on, &whole));
    // Resumed in first order, it has no correction any more.
    let fast = Solver::default().resume(part, &Stop::Never, &control).unwrap();
    let first = solve_from(f, &[(DVec2::new(30.0, 60.0), 0.0)], &Stop::Never);
    assert!(worst(&fast, &first) < 1e-4 && fast.error_at_node(100, 50).is_none());
}

#[test]
fn thread_count_changes_no_bit_of_an_update() {
    let run = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            update_one(&turning(300), DVec2::splat(140.0), &wall((170, 100), (0, 1), 50))
        })
    };
    let [one, _] = run(1);
    for threads in [2, 4] {
        let [map, _] = run(threads);
        assert_eq!(map.values, one.values);
        assert_eq!(map.statistics(), one.statistics());
    }
}
