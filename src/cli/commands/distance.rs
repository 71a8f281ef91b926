//! `ridgeway distance`: the distance from the start at every cell.

use std::path::Path;

use ridgeway::export::{Samples, isolines_geojson};
use ridgeway::grid::{isolines, levels_by_step, round_step};
use ridgeway::plan::{DistanceReport, Provenance, Scenario};
use ridgeway::terrain::Georeference;
use ridgeway::{Control, DistanceMap, Stop};

use crate::args::{AccuracyName, DistanceArgs, RunArgs};
use crate::failure::{Failure, Result};
use crate::output::{check_distinct, check_file, write_content, write_raster};
use crate::report::{Facts, Report, distance, wrote_on};
use crate::scenario::{self, command_line};

/// Isolines that a map can carry, if the user names no step.
const ISOLINES: usize = 20;

pub(super) fn run(args: &DistanceArgs, run: &RunArgs, control: &Control) -> Result<()> {
    let outputs: Vec<_> = args.output.iter().chain(&args.labels).chain(&args.isolines).collect();
    check_distinct(&outputs)?;
    if args.error && args.ground.metric_options.accuracy == AccuracyName::Fast {
        return Err(Failure::usage(
            "--error needs --accuracy high: only then the error is estimated",
        ));
    }
    for path in args.output.iter().chain(&args.labels) {
        check_file(path, &["tif", "tiff"], args.overwrite, Some(&args.dem))?;
    }
    if let Some(path) = &args.isolines {
        check_file(path, &["geojson", "json"], args.overwrite, Some(&args.dem))?;
    }
    let name = args.ground.metric_options.chosen(args.choice.metric)?;
    let places = (&args.start.start[..], &args.goal[..]);
    let (scenario, _) = scenario::prepare(&args.dem, places, &args.ground, run, control)?;
    let field = scenario::bind(&scenario, name, &args.ground, run, control)?;
    let stop = args.max_distance.map_or(Stop::Never, Stop::Distance);
    let map = scenario.solve(&field, &stop, control).map_err(Failure::naming_goals(&scenario))?;
    let provenance = scenario.provenance(std::slice::from_ref(&field), Some(command_line()));
    let isolines = match &args.isolines {
        Some(path) => Some((path, isolines_file(args, &scenario, &map, &provenance)?)),
        None => None,
    };
    control.check()?;
    if let Some((path, content)) = isolines {
        write_content(path, args.overwrite, &content)?;
    }
    if let Some(path) = &args.output {
        write_map(path, args, &scenario.georeference, &map)?;
    }
    if let Some(path) = &args.labels {
        let labels: Vec<u32> =
            map.allocation().into_iter().map(|label| label.map_or(0, |label| label + 1)).collect();
        let bands = [("nearest start".into(), Samples::U32(&labels))];
        write_raster(path, args.overwrite, &scenario.georeference, &bands)?;
    }
    let written: String =
        outputs.iter().map(|path| wrote_on(path, scenario.georeference.crs())).collect();
    let report = DistanceReport::new(&scenario, &field, &map, args.stats, provenance);
    map.check()?;
    Report::new(text(&report, args.stats) + &written, report).print(run)
}

fn write_map(
    path: &Path,
    args: &DistanceArgs,
    georeference: &Georeference,
    map: &DistanceMap,
) -> Result<()> {
    let distances = |row: usize, line: &mut [f32]| map.row(row, line);
    let azimuths = |row: usize, line: &mut [f32]| {
        each_column(line, |col| azimuth(map, col, row).unwrap_or(f32::NAN));
    };
    let errors = |row: usize, line: &mut [f32]| {
        each_column(line, |col| map.error_at_node(col, row).map_or(f32::NAN, |error| error as f32));
    };
    let unit = map.unit();
    let mut bands = vec![(format!("distance ({unit})"), Samples::F32Rows(&distances))];
    if args.direction {
        let name = "direction of travel (degrees clockwise from north)".into();
        bands.push((name, Samples::F32Rows(&azimuths)));
    }
    if args.error {
        bands.push((format!("estimated error ({unit})"), Samples::F32Rows(&errors)));
    }
    Ok(write_raster(path, args.overwrite, georeference, &bands)?)
}

/// Fills a row with the value of each column.
fn each_column(line: &mut [f32], value: impl Fn(usize) -> f32) {
    line.iter_mut().enumerate().for_each(|(col, sample)| *sample = value(col));
}

/// Direction of travel at a node, in degrees clockwise from north.
fn azimuth(map: &DistanceMap, col: usize, row: usize) -> Option<f32> {
    let travel = map.direction(col, row)?;
    Some(travel.x.atan2(travel.y).to_degrees().rem_euclid(360.0) as f32)
}

fn isolines_file(
    args: &DistanceArgs,
    scenario: &Scenario,
    map: &DistanceMap,
    provenance: &Provenance,
) -> Result<Vec<u8>> {
    let values = &map.to_row_major()[..];
    map.check()?;
    let largest = values.iter().filter(|v| v.is_finite()).fold(0f32, |a, &b| a.max(b));
    let step = args.step.unwrap_or_else(|| round_step(largest.into(), ISOLINES));
    let frame = scenario.frame();
    let lines = isolines(frame, values, &levels_by_step(values, step)?)?;
    let crs = scenario.georeference.crs();
    Ok(isolines_geojson(&lines, frame, map.unit().symbol(), crs, provenance)?.into_bytes())
}

fn text(report: &DistanceReport, stats: bool) -> String {
    let DistanceReport { unit, distance: spread, solver, .. } = report;
    let mut facts = Facts::default();
    facts.add("metric", report.metric.as_str());
    facts.add("reached", format!("{} of {} cells", report.reached, report.cells));
    for (name, value) in [
        ("10 %", spread.percent_10),
        ("25 %", spread.percent_25),
        ("median", spread.median),
        ("75 %", spread.percent_75),
        ("90 %", spread.percent_90),
        ("largest", spread.largest),
        ("mean estimated error", spread.mean_error),
    ] {
        if let Some(value) = value {
            facts.add(name, distance(value, *unit));
        }
    }
    for goal in &report.goals {
        facts.add(format!("to {}", goal.goal), distance(goal.distance, *unit));
    }
    if stats {
        let per_tile = |count: usize| count as f64 / solver.counts.tiles.max(1) as f64;
        facts.add(
            "solver",
            format!(
                "{:.2} sweeps per node, {:.2} activations per tile, {} rounds, {} bytes per node",
                per_tile(solver.counts.sweeps),
                per_tile(solver.counts.activations),
                solver.counts.rounds,
                solver.bytes_per_node,
            ),
        );
    }
    facts.to_string()
}
