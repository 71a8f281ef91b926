//! `ridgeway distance`: the distance from the start at every cell.

use std::path::Path;

use rayon::prelude::*;
use ridgeway::export::{Samples, isolines_geojson};
use ridgeway::grid::{isolines, levels_by_step, round_step};
use ridgeway::{Control, DistanceMap, Error, MetricField, Result, Stop};
use serde_json::{Value, json};

use crate::args::{AccuracyName, DistanceArgs, RunArgs};
use crate::output::{check_distinct, check_file, write_content, write_raster};
use crate::plan::Journey;
use crate::report::{Facts, Report, distance, wrote};

/// Isolines that a map can carry, if the user names no step.
const ISOLINES: usize = 20;

pub(super) fn run(args: &DistanceArgs, run: &RunArgs, control: &Control) -> Result<()> {
    let outputs: Vec<_> = args.output.iter().chain(&args.labels).chain(&args.isolines).collect();
    check_distinct(&outputs)?;
    if args.error && args.ground.metric.accuracy == AccuracyName::Fast {
        return Err(Error::usage(
            "--error needs --accuracy high: only then the error is estimated",
        ));
    }
    for path in args.output.iter().chain(&args.labels) {
        check_file(path, &["tif", "tiff"], args.overwrite, Some(&args.dem))?;
    }
    if let Some(path) = &args.isolines {
        check_file(path, &["geojson", "json"], args.overwrite, Some(&args.dem))?;
    }
    let name = args.ground.metric.chosen(args.metric)?;
    let places = (&args.start.start[..], &args.goal[..]);
    let (journey, _) = Journey::prepare(&args.dem, places, &args.ground, run, control)?;
    let field = journey.field(name, control)?;
    let stop = args.max_distance.map_or(Stop::Never, Stop::Distance);
    let map = journey.solve(&field, &stop)?;
    let provenance = journey.provenance(std::slice::from_ref(&field));
    let isolines = match &args.isolines {
        Some(path) => Some((path, isolines_file(args, &journey, &map, &provenance)?)),
        None => None,
    };
    control.check()?;
    if let Some((path, content)) = isolines {
        write_content(path, args.overwrite, &content)?;
    }
    if let Some(path) = &args.output {
        write_map(path, args, &journey, &map)?;
    }
    if let Some(path) = &args.labels {
        let labels: Vec<u32> =
            map.allocation().into_iter().map(|label| label.map_or(0, |label| label + 1)).collect();
        let bands = [("nearest start".into(), Samples::U32(&labels))];
        write_raster(path, args.overwrite, &journey.georeference, &bands)?;
    }
    let report = report(args, &journey, &field, &map, &provenance);
    let written: String = outputs.iter().map(|path| wrote(path)).collect();
    Report { text: report.text + &written, json: report.json }.print(run)
}

fn write_map(
    path: &Path,
    args: &DistanceArgs,
    journey: &Journey<'_>,
    map: &DistanceMap,
) -> Result<()> {
    let values = |row: usize, line: &mut [f32]| {
        let nodes = line.iter_mut().enumerate();
        nodes.for_each(|(col, value)| *value = map.at_node(col, row) as f32);
    };
    let azimuth = |col, row| {
        let travel = map.direction(col, row)?;
        Some(travel.x.atan2(travel.y).to_degrees().rem_euclid(360.0) as f32)
    };
    let azimuths = |row: usize, line: &mut [f32]| {
        let nodes = line.iter_mut().enumerate();
        nodes.for_each(|(col, value)| *value = azimuth(col, row).unwrap_or(f32::NAN));
    };
    let mut bands = vec![(format!("distance ({})", map.unit()), Samples::F32Rows(&values))];
    if args.direction {
        let name = "direction of travel (degrees clockwise from north)".into();
        bands.push((name, Samples::F32Rows(&azimuths)));
    }
    let errors = |row: usize, line: &mut [f32]| {
        let nodes = line.iter_mut().enumerate();
        nodes.for_each(|(col, value)| {
            *value = map.error_at_node(col, row).map_or(f32::NAN, |error| error as f32);
        });
    };
    if args.error {
        bands.push((format!("estimated error ({})", map.unit()), Samples::F32Rows(&errors)));
    }
    write_raster(path, args.overwrite, &journey.georeference, &bands)
}

fn isolines_file(
    args: &DistanceArgs,
    journey: &Journey<'_>,
    map: &DistanceMap,
    provenance: &Value,
) -> Result<Vec<u8>> {
    let values = &map.to_row_major()[..];
    let largest = values.iter().filter(|v| v.is_finite()).fold(0f32, |a, &b| a.max(b));
    let step = args.step.unwrap_or_else(|| round_step(largest.into(), ISOLINES));
    let frame = journey.georeference.frame();
    let lines = isolines(frame, values, &levels_by_step(values, step)?)?;
    let crs = journey.georeference.crs();
    Ok(isolines_geojson(&lines, frame, map.unit().symbol(), crs, provenance)?.into_bytes())
}

/// Number of the cells that are reached and the largest distance of one.
fn reached(map: &DistanceMap) -> (usize, f64) {
    let of_row = |row| {
        let values = (0..map.cols()).map(|col| f64::from(map.at_node(col, row) as f32));
        values
            .filter(|v| v.is_finite())
            .fold((0, 0.0), |(count, largest), value| (count + 1, value.max(largest)))
    };
    let both = |a: (usize, f64), b: (usize, f64)| (a.0 + b.0, a.1.max(b.1));
    (0..map.rows()).into_par_iter().map(of_row).reduce(|| (0, 0.0), both)
}

/// Mean of the estimated errors of the reached cells; `None` where there are none.
fn mean_error(map: &DistanceMap) -> Option<f64> {
    let nodes = (0..map.rows()).flat_map(|row| (0..map.cols()).map(move |col| (col, row)));
    let errors = nodes.filter_map(|(col, row)| map.error_at_node(col, row));
    let (sum, count) = errors.fold((0.0, 0usize), |(sum, count), error| (sum + error, count + 1));
    (count > 0).then(|| sum / count as f64)
}

/// Distances that these shares of the reached cells do not exceed.
fn quantiles(map: &DistanceMap) -> Vec<(&'static str, f64)> {
    let mut values = map.to_row_major();
    values.retain(|v| v.is_finite());
    values.par_sort_unstable_by(f32::total_cmp);
    [("10 %", 0.1), ("25 %", 0.25), ("median", 0.5), ("75 %", 0.75), ("90 %", 0.9)]
        .into_iter()
        .filter_map(|(name, share)| {
            let rank = (values.len().checked_sub(1)? as f64 * share) as usize;
            Some((name, values[rank].into()))
        })
        .collect()
}

fn report(
    args: &DistanceArgs,
    journey: &Journey<'_>,
    field: &MetricField<'_>,
    map: &DistanceMap,
    provenance: &Value,
) -> Report {
    let nodes = map.cols() * map.rows();
    let (reached, largest) = reached(map);
    let unit = map.unit();
    let mut facts = Facts::default();
    facts.add("metric", field.name());
    facts.add("reached", format!("{reached} of {nodes} cells"));
    let mut statistics = serde_json::Map::new();
    let mut shown = match args.stats {
        true => quantiles(map),
        false => Vec::new(),
    };
    if reached > 0 {
        shown.push(("largest", largest));
    }
    if args.stats
        && let Some(error) = mean_error(map)
    {
        shown.push(("mean estimated error", error));
    }
    for (name, value) in shown {
        facts.add(name, distance(value, unit));
        statistics.insert(name.replace(" %", "_percent"), value.into());
    }
    let mut goals = Vec::new();
    for goal in &journey.goals {
        if let Some(value) = map.at(goal.at) {
            facts.add(format!("to {}", goal.name), distance(value, unit));
            goals.push(json!({ "goal": goal.name, "distance": value }));
        }
    }
    let work = map.statistics();
    if args.stats {
        let per_tile = |count: usize| count as f64 / work.tiles.max(1) as f64;
        let activations = per_tile(work.activations);
        facts.add(
            "solver",
            format!(
                "{:.2} sweeps per node, {activations:.2} activations per tile, {} rounds, {} bytes per node",
                per_tile(work.sweeps),
                work.rounds,
                map.bytes_per_node(),
            ),
        );
    }
    Report {
        text: facts.to_string(),
        json: json!({
            "metric": field.name(),
            "unit": unit,
            "delta_per_m": field.parameter("delta_per_m"),
            "difference_delta": field.parameter("difference_delta"),
            "cells": nodes,
            "reached": reached,
            "distance": statistics,
            "goals": goals,
            "solver": {
                "tiles": work.tiles,
                "activations": work.activations,
                "sweeps": work.sweeps,
                "rounds": work.rounds,
                "bytes_per_node": map.bytes_per_node(),
            },
            "provenance": provenance,
        }),
    }
}
