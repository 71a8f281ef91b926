//! `ridgeway distance`: the distance from the start at every cell.

use ridgeway::export::{isolines, isolines_geojson, levels_by_step, round_step};
use ridgeway::{Control, DistanceMap, MetricField, Result};
use serde_json::{Value, json};

use crate::args::{DistanceArgs, RunArgs};
use crate::output::{check_distinct, check_file, write_content, write_raster};
use crate::plan::Journey;
use crate::report::{Facts, Report, distance, wrote};

/// Isolines that a map can carry, if the user names no step.
const ISOLINES: usize = 20;

pub(super) fn run(args: &DistanceArgs, run: &RunArgs, control: &Control) -> Result<()> {
    let outputs: Vec<_> = args.output.iter().chain(&args.isolines).collect();
    check_distinct(&outputs)?;
    if let Some(path) = &args.output {
        check_file(path, &["tif", "tiff"], args.overwrite, Some(&args.dem))?;
    }
    if let Some(path) = &args.isolines {
        check_file(path, &["geojson", "json"], args.overwrite, Some(&args.dem))?;
    }
    let places = (&args.start.start[..], &args.goal[..]);
    let journey = Journey::prepare(&args.dem, places, &args.ground, run, control)?;
    let field = journey.field(args.metric.unwrap_or(journey.default_metric()))?;
    let map = journey.solve(&field, true)?;
    let values = map.to_row_major();
    control.check()?;
    let provenance = journey.provenance(std::slice::from_ref(&field));
    if let Some(path) = &args.isolines {
        let content = isolines_file(args, &journey, &map, &values, &provenance)?;
        write_content(path, args.overwrite, &content)?;
    }
    if let Some(path) = &args.output {
        write_raster(path, args.overwrite, &journey.terrain, &bands(args, &map, values.clone()))?;
    }
    let report = report(args, &journey, &field, &map, values, &provenance);
    let written: String = outputs.iter().map(|path| wrote(path)).collect();
    Report { text: report.text + &written, json: report.json }.print(run)
}

fn bands(args: &DistanceArgs, map: &DistanceMap, values: Vec<f32>) -> Vec<(String, Vec<f32>)> {
    let mut bands = vec![(format!("distance ({})", map.unit()), values)];
    if args.direction {
        let nodes = (0..map.rows()).flat_map(|row| (0..map.cols()).map(move |col| (col, row)));
        let azimuth = |(col, row)| {
            let travel = map.direction(col, row)?;
            Some(travel.x.atan2(travel.y).to_degrees().rem_euclid(360.0) as f32)
        };
        bands.push((
            "direction of travel (degrees clockwise from north)".into(),
            nodes.map(|node| azimuth(node).unwrap_or(f32::NAN)).collect(),
        ));
    }
    bands
}

fn isolines_file(
    args: &DistanceArgs,
    journey: &Journey<'_>,
    map: &DistanceMap,
    values: &[f32],
    provenance: &Value,
) -> Result<Vec<u8>> {
    let largest = values.iter().filter(|v| v.is_finite()).fold(0f32, |a, &b| a.max(b));
    let step = args.step.unwrap_or_else(|| round_step(largest.into(), ISOLINES));
    let frame = journey.terrain.frame();
    let lines = isolines(frame, values, &levels_by_step(values, step)?)?;
    let crs = journey.terrain.crs();
    Ok(isolines_geojson(&lines, frame, map.unit(), crs, provenance)?.into_bytes())
}

fn report(
    args: &DistanceArgs,
    journey: &Journey<'_>,
    field: &MetricField<'_>,
    map: &DistanceMap,
    mut values: Vec<f32>,
    provenance: &Value,
) -> Report {
    let nodes = values.len();
    values.retain(|v| v.is_finite());
    values.sort_unstable_by(f32::total_cmp);
    let unit = map.unit();
    let mut facts = Facts::default();
    facts.add("metric", field.name());
    facts.add("reached", format!("{} of {nodes} cells", values.len()));
    let quantile = |share: f64| f64::from(values[((values.len() - 1) as f64 * share) as usize]);
    let mut statistics = serde_json::Map::new();
    let shown: &[(&str, f64)] = match (args.stats, values.is_empty()) {
        (_, true) => &[],
        (false, _) => &[("largest", 1.0)],
        (true, _) => &[
            ("10 %", 0.1),
            ("25 %", 0.25),
            ("median", 0.5),
            ("75 %", 0.75),
            ("90 %", 0.9),
            ("largest", 1.0),
        ],
    };
    for &(name, share) in shown {
        facts.add(name, distance(quantile(share), unit));
        statistics.insert(name.replace(" %", "_percent"), quantile(share).into());
    }
    let mut goals = Vec::new();
    for goal in &journey.goals {
        if let Some(value) = map.at(goal.at) {
            facts.add(format!("to {}", goal.name), distance(value, unit));
            goals.push(json!({ "goal": goal.name, "distance": value }));
        }
    }
    Report {
        text: facts.to_string(),
        json: json!({
            "metric": field.name(),
            "unit": unit,
            "delta_per_m": field.delta(),
            "cells": nodes,
            "reached": values.len(),
            "distance": statistics,
            "goals": goals,
            "provenance": provenance,
        }),
    }
}
