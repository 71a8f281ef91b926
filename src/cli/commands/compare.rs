//! `ridgeway compare`: one pair of places under several metrics.

use ridgeway::export::routes_geojson;
use ridgeway::metric::NamedMetric;
use ridgeway::{Comparison, Control, Error, MetricField, Result, Route, Terrain};
use serde_json::{Value, json};

use super::render;
use super::route::{HEADER, measures, profiles};
use crate::args::{CURVATURE, CompareArgs, RunArgs, known};
use crate::output::{check_outputs_in, write_contents};
use crate::plan::Journey;
use crate::report::{Report, Table, wrote_in};

const FILES: [&str; 4] = ["routes.geojson", "profile.csv", "summary.json", "map.png"];

/// Length of the longer side of `map.png`.
const PIXELS: u32 = 1600;

pub(super) fn run(args: &CompareArgs, run: &RunArgs, control: &Control) -> Result<()> {
    if let Some(folder) = &args.output {
        check_outputs_in(folder, &FILES, args.overwrite)?;
    }
    let metrics = metrics(args)?;
    let places = (&args.start.start[..], std::slice::from_ref(&args.goal));
    let (journey, terrain) = Journey::prepare(&args.dem, places, &args.ground, run, control)?;
    let [goal] = &journey.goals[..] else {
        return Err(Error::usage(format!(
            "--goal {} holds {} points; compare takes one goal",
            args.goal,
            journey.goals.len()
        )));
    };
    let fields = metrics
        .into_iter()
        .map(|metric| journey.field(metric, control))
        .collect::<Result<Vec<_>>>()?;
    let comparison = Comparison::between(
        args.ground.metric.solver(),
        &fields,
        &journey.regions,
        goal.at,
        control,
    )
    .or_else(|error| journey.explain(error, &fields))?;
    let table = table(&fields, &comparison).to_string();
    let summary = summary(&fields, &comparison, &journey);
    if let Some(folder) = &args.output {
        let contents = contents(args, &fields, &comparison, &summary, (&journey, &terrain))?;
        control.check()?;
        write_contents(folder, args.overwrite, &FILES, &contents)?;
    }
    let written = args.output.iter().map(|folder| wrote_in(folder, &FILES));
    Report { text: table + EXPLANATION + &written.collect::<String>(), json: summary }.print(run)
}

const EXPLANATION: &str =
    "x METRIC: cost under that metric, as a ratio to the best route under it\n";

/// The metrics asked for, each once.
fn metrics(args: &CompareArgs) -> Result<Vec<NamedMetric>> {
    let mut metrics = args.metrics.clone();
    if metrics.is_empty() {
        metrics = ["isotropic", CURVATURE, "difference"].map(known).into();
        metrics.push(args.ground.metric.default_metric());
    }
    args.ground.metric.check_tensor(&metrics)?;
    let mut once: Vec<NamedMetric> = Vec::new();
    for metric in metrics {
        if !once.iter().any(|other| other.name == metric.name) {
            once.push(metric);
        }
    }
    Ok(once)
}

fn table(fields: &[MetricField<'_>], comparison: &Comparison) -> Table {
    let mut table = Table::default();
    let ratios = fields.iter().map(|field| format!("x {}", field.name()));
    table.row(HEADER.into_iter().map(String::from).chain(ratios));
    for (r, (field, route)) in fields.iter().zip(&comparison.routes).enumerate() {
        let ratios = (0..fields.len()).map(|m| format!("{:.3}", comparison.ratio(m, r)));
        table.row(measures(field.name(), route).into_iter().chain(ratios));
    }
    table
}

fn summary(fields: &[MetricField<'_>], comparison: &Comparison, journey: &Journey<'_>) -> Value {
    let routes: Vec<_> = fields
        .iter()
        .zip(&comparison.routes)
        .enumerate()
        .map(|(r, (field, route))| {
            let costs: serde_json::Map<_, _> = fields
                .iter()
                .enumerate()
                .map(|(m, under)| {
                    let cost = json!({
                        "cost": comparison.costs[m][r],
                        "unit": under.unit(),
                        "ratio_to_best": comparison.ratio(m, r),
                    });
                    (under.name().to_owned(), cost)
                })
                .collect();
            json!({ "name": field.name(), "summary": route.summary, "costs": costs })
        })
        .collect();
    json!({ "routes": routes, "provenance": journey.provenance(fields) })
}

/// The content of each of [`FILES`].
fn contents(
    args: &CompareArgs,
    fields: &[MetricField<'_>],
    comparison: &Comparison,
    summary: &Value,
    (journey, terrain): (&Journey<'_>, &Terrain),
) -> Result<[Vec<u8>; FILES.len()]> {
    let named: Vec<(&str, &Route)> =
        fields.iter().map(MetricField::name).zip(&comparison.routes).collect();
    let Comparison { routes, distances, .. } = comparison;
    let geojson = routes_geojson(&named, journey.georeference.crs(), &journey.provenance(fields))?;
    Ok([
        geojson.into_bytes(),
        profiles(&named, journey)?,
        format!("{summary:#}\n").into_bytes(),
        render::map((journey, terrain), &args.dem, fields, routes, distances, PIXELS)?,
    ])
}
