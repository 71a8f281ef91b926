//! From flags to a scenario, and to metrics on it.

use std::path::Path;

use ridgeway::metric::NamedMetric;
use ridgeway::plan::{Place, Question, Scenario};
use ridgeway::{Control, HeightSurface, MetricField, Terrain};

use crate::args::{FitArgs, GroundArgs, RunArgs};
use crate::failure::Result;
use crate::report::{self, digits};

/// The DEM with its places and all else that flags name, and the terrain for those who draw its relief; others drop it, and its
/// memory.
///
/// # Errors
/// Any input that cannot be read or used; a place outside the DEM, on a void or on a barrier.
pub(crate) fn prepare(
    dem: &Path,
    (starts, goals): (&[Place], &[Place]),
    ground: &GroundArgs,
    run: &RunArgs,
    control: &Control,
) -> Result<(Scenario, Terrain)> {
    let metric = &ground.metric_options;
    let question = Question {
        dem: dem.to_owned(),
        height_unit: ground.fit.height_unit(),
        starts: starts.to_vec(),
        goals: goals.to_vec(),
        fit: ground.fit.options(),
        solver: metric.solver(),
        climb_weight: metric.climb_weight,
        max_slope_deg: metric.max_slope,
        barriers: metric.barrier.clone(),
        cost: metric.cost.clone(),
        tensors: metric.tensor.clone(),
    };
    let terrain = open(dem, &ground.fit, run)?;
    let scenario = Scenario::on(&terrain, question, control)?;
    report::notes(&scenario.notes, run);
    Ok((scenario, terrain))
}

/// Reads the DEM and prints what its reader noticed.
pub(crate) fn open(dem: &Path, args: &FitArgs, run: &RunArgs) -> Result<Terrain> {
    let terrain = Terrain::open_in(dem, args.height_unit())?;
    report::notes(terrain.notes(), run);
    Ok(terrain)
}

/// Fits the surface; an error names the DEM.
pub(crate) fn fit(
    dem: &Path,
    terrain: &Terrain,
    args: &FitArgs,
    control: &Control,
) -> Result<HeightSurface> {
    Ok(HeightSurface::fit(terrain, &args.options(), control).map_err(|error| error.in_file(dem))?)
}

/// The metric of this name on the surface of the scenario, with what the flags say of it.
///
/// # Errors
/// `tensor` without `--tensor`; a start or goal on a node that is closed under the metric; cancelled.
pub(crate) fn bind<'a>(
    scenario: &'a Scenario,
    metric: NamedMetric,
    ground: &GroundArgs,
    run: &RunArgs,
    control: &Control,
) -> Result<MetricField<'a>> {
    let metric = ground.metric_options.metric(metric, scenario.tensors())?;
    let field = scenario.bind(&metric, control)?;
    if !run.quiet
        && let Some(level) = scenario.level_cost_dominated_by_climb(&field)
    {
        eprintln!(
            "note: --climb-weight {} is more than 1000 times what level ground costs on the {} metric, {}: \
             distances come out far too short; 100 times would be {}",
            ground.metric_options.climb_weight,
            field.name(),
            digits(level),
            digits(100.0 * level)
        );
    }
    Ok(field)
}

/// The command line, quoted for a shell.
pub(crate) fn command_line() -> String {
    std::env::args_os()
        .enumerate()
        .map(|(i, word)| match i {
            0 => "ridgeway".into(),
            _ => quoted(&word.to_string_lossy()),
        })
        .collect::<Vec<_>>()
        .join(" ")
}

fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_alphanumeric() || "-_=+./,:%@".contains(c);
    if !word.is_empty() && word.chars().all(plain) {
        word.into()
    } else {
        format!("'{}'", word.replace('\'', r"'\''"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_are_quoted_for_a_shell() {
        assert_eq!(quoted("--start=-3,4"), "--start=-3,4");
        assert_eq!(quoted("my dem.tif"), "'my dem.tif'");
        assert_eq!(quoted("it's"), r"'it'\''s'");
        assert_eq!(quoted(""), "''");
    }
}
