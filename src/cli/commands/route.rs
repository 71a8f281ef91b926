//! `ridgeway route`: a route from the start to each goal.

use rayon::prelude::*;
use ridgeway::export::{routes_geojson, routes_gpx, write_profiles};
use ridgeway::route::trace;
use ridgeway::{Control, Error, Result, Route};
use serde_json::{Value, json};

use crate::args::{RouteArgs, RunArgs};
use crate::output::{check_distinct, check_file, write_content};
use crate::places::Spot;
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
    let name = args.ground.metric.chosen(args.metric)?;
    let places = (&args.start.start[..], &args.goal[..]);
    let (journey, _) = Journey::prepare(&args.dem, places, &args.ground, run, control)?;
    let field = journey.field(name, control)?;
    let map = journey.solve(&field, &journey.all_goals())?;
    let to_goal = |goal: &Spot| {
        control.check()?;
        Ok((format!("to {}", goal.name), trace(&map, &field, goal.at)?))
    };
    let routes = journey.goals.par_iter().map(to_goal).collect::<Result<Vec<_>>>()?;
    control.check()?;
    let named: Vec<_> = routes.iter().map(|(name, route)| (name.as_str(), route)).collect();
    let provenance = journey.provenance(std::slice::from_ref(&field));
    // All contents are made before the first file is written.
    let contents = formats
        .iter()
        .map(|format| content(format, &journey, &named, &provenance))
        .collect::<Result<Vec<_>>>()?;
    for (path, content) in args.output.iter().zip(&contents) {
        write_content(path, args.overwrite, content)?;
    }
    let written: String = args.output.iter().map(|path| wrote(path)).collect();
    let routes: Vec<_> = named
        .iter()
        .map(|(name, route)| json!({ "name": name, "summary": route.summary }))
        .collect();
    Report {
        text: table(&named).to_string() + &written,
        json: json!({ "routes": routes, "provenance": provenance }),
    }
    .print(run)
}

/// The file of a format.
fn content(
    format: &str,
    journey: &Journey<'_>,
    routes: &[(&str, &Route)],
    provenance: &Value,
) -> Result<Vec<u8>> {
    let crs = journey.georeference.crs();
    Ok(match format {
        "gpx" => routes_gpx(routes, crs)?.into_bytes(),
        "csv" => profiles(routes, journey)?,
        _ => routes_geojson(routes, crs, provenance)?.into_bytes(),
    })
}

/// The profiles of routes at a step of one cell, as CSV.
pub(super) fn profiles(routes: &[(&str, &Route)], journey: &Journey<'_>) -> Result<Vec<u8>> {
    let step = journey.georeference.frame().mid_spacing().min_element();
    let profiles: Vec<_> =
        routes.iter().map(|(name, route)| (*name, route.profile(&journey.surface, step))).collect();
    let mut csv = Vec::new();
    write_profiles(&mut csv, &profiles).map_err(|source| Error::io("profile", source))?;
    Ok(csv)
}

fn table(routes: &[(&str, &Route)]) -> Table {
    let mut table = Table::default();
    table.row(HEADER.into_iter().chain(["cost"]));
    for (name, route) in routes {
        let s = &route.summary;
        table.row(measures(name, route).into_iter().chain([distance(s.cost, s.cost_unit)]));
    }
    table
}

/// Head of the columns that [`measures`] fills.
pub(super) const HEADER: [&str; 8] =
    ["route", "length", "climb", "descent", "max grade", "mean grade", "side slope", "∫|κn|ds"];

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
