//! Updates after an edit against solves from the beginning.

use super::*;

type Edits = Vec<(usize, usize, Option<Sym2>)>;

/// The largest relative difference between an update and a solve from the beginning; infinite if one reaches what
/// the other does not.
fn difference(update: &DistanceMap, fresh: &DistanceMap) -> f64 {
    let worst = |(a, b): (f32, f32)| {
        if a == b { 0.0 } else { f64::from((a - b).abs()) / f64::from(b) }
    };
    let pairs = update.to_row_major().into_iter().zip(fresh.to_row_major());
    pairs.map(worst).map(|d| if d.is_nan() { f64::INFINITY } else { d }).fold(0.0, f64::max)
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

/// A field that is smooth, rough or a maze, and may have alike ground around the start.
fn any_field() -> impl Strategy<Value = TensorField> {
    let rough = proptest::collection::vec(any_tensor(), 60 * 50);
    let rough = rough.prop_map(|tensors| field(60, 50, |c, r| tensors[r * 60 + c]));
    let smooth = (0.0..100f64.ln(), 0.0..TAU, 0.0..0.1f64).prop_map(|(ratio, angle, turn)| {
        field(60, 50, |c, r| Some(rotated(ratio.exp(), angle + turn * (c + 2 * r) as f64)))
    });
    let maze = (2..6usize, 3..9usize, any::<u64>()).prop_map(|(width, gap, seed)| {
        field(60, 50, |c, r| {
            let wall =
                c % (width + 1) == width && (r + (seed >> (c % 32)) as usize) % (gap + 8) > 0;
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
        stop in prop_oneof![3 => Just(Stop::Never), 1 => (0.0..40.0f64).prop_map(Stop::Distance)],
    ) {
        let second = StartRegion::from(DVec2::new(other, x.min(49.0))).with_value(value);
        let starts = [StartRegion::from(DVec2::new(x, y)), second];
        let tolerance = if exact { 0.0 } else { Solver::default().tolerance };
        let solver = Solver { tolerance, ..Solver::default() };
        if let Some([update, fresh]) = both(&solver, &f, &starts, &edits, &stop) {
            let bound = if exact { 1e-5 } else { 1e-3 };
            let difference = difference(&update, &fresh);
            prop_assert!(difference <= bound, "{difference:e}");
        }
    }
}
