//! Grids that close on themselves: the parameters of cylinders and tori.

use super::*;

/// Both accuracies.
const ACCURACIES: [Accuracy; 2] = [Accuracy::Fast, Accuracy::High];

fn torus(
    cols: usize,
    rows: usize,
    directions: [bool; 2],
    tensor: impl Fn(usize, usize) -> Option<Sym2> + Sync,
) -> TensorField {
    field(cols, rows, tensor).periodic(directions).unwrap()
}

fn solve_as(accuracy: Accuracy, field: TensorField, start: DVec2) -> DistanceMap {
    let solver = Solver { accuracy, ..Solver::default() };
    solver.solve_field(field, &[start.into()], &Stop::Never, &Control::default()).unwrap()
}

/// The least of a length over the images of a way.
fn over_images(
    way: DVec2,
    period: DVec2,
    [across, down]: [bool; 2],
    length: impl Fn(DVec2) -> f64,
) -> f64 {
    let turns = |periodic: bool| if periodic { -40..=40 } else { 0..=0 };
    let images = turns(down).flat_map(|j| turns(across).map(move |i| (i, j)));
    let lengths =
        images.map(|(i, j)| length(way + period * DVec2::new(f64::from(i), f64::from(j))));
    lengths.fold(f64::INFINITY, f64::min)
}

#[test]
fn the_distance_is_that_of_the_nearest_image() {
    for (cols, rows) in
        [(17, 40), (33, 33), (50, 64), (100, 48), (48, 100), (16, 60), (20, 90), (3, 50), (5, 70)]
    {
        for directions in [[true, false], [false, true], [true, true]] {
            for d in [IDENTITY, rotated(9.0, 0.4)] {
                let start = DVec2::new(0.3 * cols as f64, rows as f64 - 1.4);
                let period = DVec2::new(cols as f64, rows as f64);
                let exact = |c: usize, r: usize| {
                    let way = DVec2::new(c as f64, r as f64) - start;
                    Some(over_images(way, period, directions, |v| d.inverse().norm(v)))
                };
                for accuracy in ACCURACIES {
                    let map =
                        solve_as(accuracy, torus(cols, rows, directions, |_, _| Some(d)), start);
                    let (worst, mean) = errors(&map, exact);
                    println!("{cols} {rows} {directions:?} {accuracy:?} {worst:.1e} {mean:.1e}");
                }
            }
        }
    }
}
