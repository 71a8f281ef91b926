//! `ridgeway compare`: one pair of places under several metrics.

use std::path::Path;

use ridgeway::export::routes_geojson;
use ridgeway::metric::NamedMetric;
use ridgeway::plan::{ComparisonReport, Scenario};
use ridgeway::terrain::Crs;
use ridgeway::{Comparison, Control, MetricField, Route, Terrain};

use super::render;
use super::route::{HEADER, HEIGHTS, measures, profiles};
use crate::args::{CURVATURE, CompareArgs, RunArgs, metric_named};
use crate::failure::{Failure, Result};
use crate::output::{check_outputs_in, write_contents};
use crate::report::{Report, Table, json, wrote_in, wrote_on};
use crate::scenario::{self, command_line};

const FILES: [&str; 4] = ["routes.geojson", "profile.csv", "summary.json", "map.png"];

/// Length of the longer side of `map.png`.
const PIXELS: u32 = 1600;

pub(super) fn run(args: &CompareArgs, run: &RunArgs, control: &Control) -> Result<()> {
    if let Some(folder) = &args.output {
        check_outputs_in(folder, &FILES, args.overwrite)?;
    }
    let metrics = metrics(args)?;
    let places = (&args.start.start[..], std::slice::from_ref(&args.goal));
    let (scenario, terrain) = scenario::prepare(&args.dem, places, &args.ground, run, control)?;
    if scenario.goals.len() != 1 {
        return Err(Failure::usage(format!(
            "--goal {} holds {} points; compare takes one goal",
            args.goal,
            scenario.goals.len()
        )));
    }
    let fields = metrics
        .into_iter()
        .map(|metric| scenario::bind(&scenario, metric, &args.ground, run, control))
        .collect::<Result<Vec<_>>>()?;
    let comparison =
        scenario.compare(&fields, control).map_err(Failure::naming_goals(&scenario))?;
    let provenance = scenario.provenance(&fields, Some(command_line()));
    let report = ComparisonReport::new(&fields, &comparison, &terrain, provenance);
    let table = table(&fields, &comparison, &report).to_string();
    if let Some(folder) = &args.output {
        let contents = contents((&scenario, &terrain), &fields, &comparison, &report, control)?;
        control.check()?;
        write_contents(folder, args.overwrite, &FILES, &contents)?;
    }
    let written = args.output.iter().map(|folder| wrote_files(folder, scenario.georeference.crs()));
    Report::new(table + HEIGHTS + EXPLANATION + &written.collect::<String>(), report).print(run)
}

const EXPLANATION: &str =
    "x METRIC: cost under that metric, as a ratio to the best route under it\n";

/// The metrics asked for, each once.
fn metrics(args: &CompareArgs) -> Result<Vec<NamedMetric>> {
    let mut metrics = args.metrics.clone();
    if metrics.is_empty() {
        metrics = ["isotropic", CURVATURE, "difference"].map(metric_named).into();
        metrics.push(args.ground.metric_options.default_metric());
    }
    args.ground.metric_options.check_tensor(&metrics)?;
    let mut once: Vec<NamedMetric> = Vec::new();
    for metric in metrics {
        if !once.iter().any(|other| other.name == metric.name) {
            once.push(metric);
        }
    }
    Ok(once)
}

/// Lines that name the files: the first is GeoJSON.
fn wrote_files(folder: &Path, crs: &Crs) -> String {
    wrote_on(&folder.join(FILES[0]), crs) + &wrote_in(folder, &FILES[1..])
}

fn table(fields: &[MetricField<'_>], comparison: &Comparison, report: &ComparisonReport) -> Table {
    let mut table = Table::default();
    let ratios = fields.iter().map(|field| format!("x {}", field.name()));
    table.row(HEADER.into_iter().map(String::from).chain(ratios));
    for (r, compared) in report.routes.iter().enumerate() {
        let ratios = (0..fields.len()).map(|m| format!("{:.3}", comparison.ratio(m, r)));
        table.row(measures(&compared.route).into_iter().chain(ratios));
    }
    table
}

/// The content of each of [`FILES`].
fn contents(
    (scenario, terrain): (&Scenario, &Terrain),
    fields: &[MetricField<'_>],
    comparison: &Comparison,
    report: &ComparisonReport,
    control: &Control,
) -> Result<[Vec<u8>; FILES.len()]> {
    let Comparison { routes, distances, .. } = comparison;
    let named: Vec<(&str, &Route)> = fields.iter().map(MetricField::name).zip(routes).collect();
    let geojson = routes_geojson(&named, scenario.georeference.crs(), &report.provenance)?;
    Ok([
        geojson.into_bytes(),
        profiles(&named, (scenario, terrain))?,
        json(report).into_bytes(),
        render::map((scenario, terrain), fields, routes, distances, PIXELS, control)?,
    ])
}
