//! `ridgeway route`: a route from the start to each goal.

use std::path::Path;

use ridgeway::export::{routes_geojson, routes_gpx, write_file, write_profiles};
use ridgeway::route::trace;
use ridgeway::{Control, Result, Route};
use serde_json::{Value, json};

use crate::args::{RouteArgs, RunArgs};
use crate::output::{check_distinct, check_file, write_text};
use crate::plan::Journey;
use crate::report::{Report, Table, distance, metres, wrote};

pub(super) fn run(args: &RouteArgs, run: &RunArgs, control: &Control) -> Result<()> {
    check_distinct(&args.output.iter().collect::<Vec<_>>())?;
    let formats = args
        .output
        .iter()
        .map(|path| {
            check_file(path, &["geojson", "json", "gpx", "csv"], args.overwrite, Some(&args.dem))
        })
        .collect::<Result<Vec<_>>>()?;
    let places = (&args.start.start[..], &args.goal[..]);
    let journey = Journey::prepare(&args.dem, places, &args.ground, run, control)?;
    let field = journey.field(args.metric.unwrap_or(journey.default_metric()))?;
    let map = journey.solve(&field, false)?;
    let mut routes = Vec::new();
    for goal in &journey.goals {
        control.check()?;
        routes.push((format!("to {}", goal.name), trace(&map, &field, goal.at)?));
    }
    control.check()?;
    let named: Vec<_> = routes.iter().map(|(name, route)| (name.as_str(), route)).collect();
    for (path, format) in args.output.iter().zip(&formats) {
        write(path, format, args.overwrite, &journey, &named)?;
    }
    let written: String = args.output.iter().map(|path| wrote(path)).collect();
    Report { text: table(&named).to_string() + &written, json: machine(&named, &journey) }
        .print(run)
}

fn write(
    path: &Path,
    format: &str,
    overwrite: bool,
    journey: &Journey<'_>,
    routes: &[(&str, &Route)],
) -> Result<()> {
    let crs = journey.terrain.crs();
    match format {
        "gpx" => write_text(path, overwrite, &routes_gpx(routes, crs)?),
        "csv" => {
            let profiles: Vec<_> =
                routes.iter().map(|(name, route)| (*name, profile(route, journey))).collect();
            write_file(path, overwrite, |out| write_profiles(out, &profiles))
        }
        _ => write_text(path, overwrite, &routes_geojson(routes, crs, &journey.provenance())?),
    }
}

/// The profile of a route at a step of one cell.
pub(super) fn profile(route: &Route, journey: &Journey<'_>) -> Vec<ridgeway::route::ProfilePoint> {
    route.profile(&journey.surface, journey.terrain.frame().mid_spacing().min_element())
}

fn table(routes: &[(&str, &Route)]) -> Table {
    let mut table = Table::default();
    table.row(HEADER.into_iter().chain(["cost"]));
    for (name, route) in routes {
        let s = &route.summary;
        table.row(measures(name, route).into_iter().chain([distance(s.cost, &s.cost_unit)]));
    }
    table
}

/// Head of the columns that [`measures`] fills.
pub(super) const HEADER: [&str; 8] =
    ["route", "length", "climb", "descent", "max grade", "mean grade", "side slope", "total bend"];

/// The cells of a route's row.
pub(super) fn measures(name: &str, route: &Route) -> [String; 8] {
    let s = &route.summary;
    [
        name.into(),
        metres(s.length_m),
        metres(s.climb_m),
        metres(s.descent_m),
        format!("{:.1} %", s.max_grade_percent),
        format!("{:.1} %", s.mean_grade_percent),
        format!("{:.1}°", s.max_side_slope_deg),
        format!("{:.2} rad", s.total_normal_curvature_rad),
    ]
}

/// The routes for machines: name and summary.
pub(super) fn machine(routes: &[(&str, &Route)], journey: &Journey<'_>) -> Value {
    let routes: Vec<_> = routes
        .iter()
        .map(|(name, route)| json!({ "name": name, "summary": route.summary }))
        .collect();
    json!({ "routes": routes, "provenance": journey.provenance() })
}
