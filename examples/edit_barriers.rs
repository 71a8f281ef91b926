//! Close a wall, see what changes, and open it again: a map of distances is updated instead of solved anew.
//!
//! Prints, for walls of 50 nodes across the path east of the start, the time of an update and of a solve from the
//! beginning, and how many tiles each solved.
//!
//! `cargo run --release --example edit_barriers [nodes along a side [repetitions [fast|high]]]`

use std::time::Instant;

use ridgeway::eikonal::TensorField;
use ridgeway::{Accuracy, Control, DistanceMap, Error, Solver, Stop, Sym2};

const WALL: usize = 50;

fn main() -> Result<(), Error> {
    let number = |place: usize| std::env::args().nth(place).and_then(|text| text.parse().ok());
    let (n, repetitions) = (number(1).unwrap_or(501), number(2).unwrap_or(1));
    let is_high = std::env::args().nth(3).is_some_and(|accuracy| accuracy == "high");
    let accuracy = if is_high { Accuracy::High } else { Accuracy::Fast };
    let (solver, control) = (Solver { accuracy, ..Solver::default() }, Control::default());
    let middle = n / 2;
    let start = [glam::DVec2::splat(middle as f64).into()];
    // Ground whose fast direction turns, three times as fast along as across.
    let tensor = |col: usize, row: usize| {
        let along = glam::DVec2::from_angle(4.0 * (col + 2 * row) as f64 / n as f64);
        Sym2::outer(along) * 3.0 + Sym2::outer(along.perp()) * (1.0 / 3.0)
    };
    let field = TensorField::from_fn(n, n, |col, row| Some(tensor(col, row)), &control)?;
    let map = solver.solve_field(field.clone(), &start, &Stop::Never, &control)?;
    println!(
        "wall at, close ms, open ms, compare and close ms, solve ms, tiles solved: close, open, solve, difference"
    );
    for at in [0.05, 0.5, 0.95] {
        let col = middle + (at * middle as f64) as usize;
        let rows = middle.saturating_sub(WALL / 2)..(middle + WALL / 2).min(n);
        let closed: Vec<_> = rows.clone().map(|row| (col, row, None)).collect();
        let open: Vec<_> = rows.map(|row| (col, row, Some(tensor(col, row)))).collect();
        let mut edited = field.clone();
        for &(col, row, tensor) in &closed {
            edited.set(col, row, tensor)?;
        }
        let mut times = [const { Vec::new() }; 4];
        let mut tiles = [0; 3];
        let mut worst = 0.0_f32;
        for _ in 0..repetitions {
            let (mut map, edited) = (map.clone(), edited.clone());
            let (other, again) = (map.clone(), edited.clone());
            map =
                timed(&mut times[0], || solver.update_nodes(map, &closed, &Stop::Never, &control))?;
            tiles[0] = map.statistics().activations;
            let compared = timed(&mut times[2], || {
                solver.update_field(other, edited, &Stop::Never, &control)
            })?;
            let fresh =
                timed(&mut times[3], || solver.solve_field(again, &start, &Stop::Never, &control))?;
            tiles[2] = fresh.statistics().activations;
            worst = worst.max(difference(&map, &fresh)).max(difference(&compared, &fresh));
            map = timed(&mut times[1], || solver.update_nodes(map, &open, &Stop::Never, &control))?;
            tiles[1] = map.statistics().activations;
        }
        let [close, open, compare, solve] = times.map(median);
        let [closing, opening, solving] = tiles;
        println!(
            "{at}, {close:.2}, {open:.2}, {compare:.2}, {solve:.2}, {closing}, {opening}, {solving}, {worst:.1e}"
        );
    }
    Ok(())
}

fn timed<T>(times: &mut Vec<f64>, work: impl FnOnce() -> T) -> T {
    let begin = Instant::now();
    let outcome = work();
    times.push(1e3 * begin.elapsed().as_secs_f64());
    outcome
}

fn median(mut times: Vec<f64>) -> f64 {
    times.sort_unstable_by(f64::total_cmp);
    times[times.len() / 2]
}

/// The largest difference, as a share of the largest distance.
fn difference(a: &DistanceMap, b: &DistanceMap) -> f32 {
    let (a, b) = (a.to_row_major(), b.to_row_major());
    let largest = b.iter().copied().filter(|g| g.is_finite()).fold(0.0, f32::max);
    a.iter()
        .zip(&b)
        .filter(|(a, b)| a != b)
        .map(|(a, b)| (a - b).abs() / largest)
        .fold(0.0, f32::max)
}
