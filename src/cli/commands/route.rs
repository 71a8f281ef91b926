//! `ridgeway route`: a route from the start to each goal.

use ridgeway::export::{routes_geojson, routes_gpx, write_profiles};
use ridgeway::plan::{NamedRoute, Provenance, RouteReport, Scenario};
use ridgeway::{Control, Error, Route, Terrain};

use crate::args::{RouteArgs, RunArgs};
use crate::failure::{Failure, Result};
use crate::output::{check_distinct, check_file, write_content};
use crate::report::{Report, Table, distance, metres, wrote_on};
use crate::scenario::{self, command_line};

pub(super) fn run(args: &RouteArgs, run: &RunArgs, control: &Control) -> Result<()> {
    check_distinct(&args.output.iter().collect::<Vec<_>>())?;
    let formats = args
        .output
        .iter()
        .map(|path| {
            check_file(path, &["geojson", "json", "gpx", "csv"], args.overwrite, Some(&args.dem))
        })
        .collect::<Result<Vec<_>>>()?;
    let name = args.ground.metric_options.chosen(args.choice.metric)?;
    let places = (&args.start.start[..], &args.goal[..]);
    let (scenario, terrain) = scenario::prepare(&args.dem, places, &args.ground, run, control)?;
    let field = scenario::bind(&scenario, name, &args.ground, run, control)?;
    let routes = scenario.routes(&field, control).map_err(Failure::naming_goals(&scenario))?;
    control.check()?;
    let names: Vec<_> = scenario.goals.iter().map(|goal| format!("to {}", goal.name)).collect();
    let named: Vec<_> = names.iter().map(String::as_str).zip(&routes).collect();
    let provenance = scenario.provenance(std::slice::from_ref(&field), Some(command_line()));
    // All contents are made before the first file is written.
    let contents = formats
        .iter()
        .map(|format| content(format, (&scenario, &terrain), &named, &provenance))
        .collect::<Result<Vec<_>>>()?;
    for (path, content) in args.output.iter().zip(&contents) {
        write_content(path, args.overwrite, content)?;
    }
    let written: String =
        args.output.iter().map(|path| wrote_on(path, scenario.georeference.crs())).collect();
    let report = RouteReport::new(&named, &terrain, provenance);
    let text = table(&report).to_string() + HEIGHTS + &written;
    Report::new(text, report).print(run)
}

/// The file of a format.
fn content(
    format: &str,
    (scenario, terrain): (&Scenario, &Terrain),
    routes: &[(&str, &Route)],
    provenance: &Provenance,
) -> Result<Vec<u8>> {
    let crs = scenario.georeference.crs();
    Ok(match format {
        "gpx" => routes_gpx(routes, crs)?.into_bytes(),
        "csv" => profiles(routes, (scenario, terrain))?,
        _ => routes_geojson(routes, crs, provenance)?.into_bytes(),
    })
}

/// The profiles of routes at a step of one cell, as CSV.
pub(super) fn profiles(
    routes: &[(&str, &Route)],
    (scenario, terrain): (&Scenario, &Terrain),
) -> Result<Vec<u8>> {
    let step = scenario.frame().mid_spacing().min_element();
    let profiles: Vec<_> = routes
        .iter()
        .map(|(name, route)| (*name, route.profile(&scenario.surface, step)))
        .collect();
    let mut csv = Vec::new();
    write_profiles(&mut csv, &profiles, terrain).map_err(|source| Error::io("profile", source))?;
    Ok(csv)
}

fn table(report: &RouteReport) -> Table {
    let mut table = Table::default();
    table.row(HEADER.into_iter().chain(["cost"]));
    for route in &report.routes {
        let cost = distance(route.summary.cost, route.summary.cost_unit);
        table.row(measures(route).into_iter().chain([cost]));
    }
    table
}

/// Which heights the columns of [`HEADER`] are of.
pub(super) const HEIGHTS: &str = "climb, descent and grades are those of the smooth surface; DEM climb is that of the heights of the DEM\n";

/// Head of the columns that [`measures`] fills.
pub(super) const HEADER: [&str; 9] = [
    "route",
    "length",
    "climb",
    "descent",
    "DEM climb",
    "max grade",
    "mean grade",
    "side slope",
    "∫|κn|ds",
];

/// The cells of a route's row.
pub(super) fn measures(route: &NamedRoute) -> [String; 9] {
    let NamedRoute { name, summary, on_dem } = route;
    [
        name.clone(),
        metres(summary.length_m),
        metres(summary.climb_m),
        metres(summary.descent_m),
        metres(on_dem.climb_m),
        format!("{:.1} %", summary.max_grade_percent),
        format!("{:.1} %", summary.mean_grade_percent),
        format!("{:.1}°", summary.max_side_slope_deg),
        format!("{:.2} rad", summary.total_normal_curvature_rad),
    ]
}
