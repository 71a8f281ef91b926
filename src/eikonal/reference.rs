//! The slow and obviously right solver: judge of the tests.

use super::cone::Cones;
use super::field::TensorField;
use super::source::StartRegion;
use super::{DistanceMap, Statistics, best_foot, seeded};
use crate::{Control, Error, Result};

/// Sweeps after which a solve is given up.
const MOST_SWEEPS: usize = 2000;

/// The same start values and the same discrete equation as [`Solver`](super::Solver), but each node's update is the plain
/// minimum over the ring and whole-grid Gauss–Seidel sweeps go on until no node changes at all.
///
/// # Errors
/// As [`Solver::solve`](super::Solver::solve).
pub fn solve(field: TensorField, starts: &[StartRegion], control: &Control) -> Result<DistanceMap> {
    let mut values = seeded(&field, starts)?;
    let cones = Cones::new(&field, starts);
    let (cols, rows) = (field.cols(), field.rows());
    let mut changed = true;
    let mut sweep = 0;
    while changed {
        control.check()?;
        changed = false;
        for j in 0..rows {
            let row = if sweep & 2 == 0 { j } else { rows - 1 - j };
            for i in 0..cols {
                let col = if sweep & 1 == 0 { i } else { cols - 1 - i };
                let old = values.get(col, row);
                let new = best_foot(&field, &cones, &values, col, row)
                    .map_or(f32::INFINITY, |(g, _)| g as f32);
                if new < old {
                    values.lower(col, row, new);
                    changed = true;
                }
            }
        }
        sweep += 1;
        if sweep > MOST_SWEEPS {
            return Err(Error::usage("the distance does not settle on this metric"));
        }
    }
    let statistics = Statistics { sweeps: sweep, ..Statistics::default() };
    Ok(DistanceMap {
        field,
        cones,
        values,
        starts: starts.into(),
        statistics,
        unit: "",
        frame: None,
    })
}
