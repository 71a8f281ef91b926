//! `ridgeway info`: what a DEM holds.

use ridgeway::Ground;
use ridgeway::plan::{InfoReport, coordinate};

use crate::args::{InfoArgs, RunArgs};
use crate::failure::Result;
use crate::report::{Facts, Report, digits};
use crate::scenario;

pub(super) fn run(args: &InfoArgs, run: &RunArgs) -> Result<()> {
    let terrain = scenario::open(&args.dem, &args.fit, run)?;
    let report = InfoReport::new(&args.dem, &terrain, &args.fit.options());
    let is_in_metres = terrain.crs().ground() == Ground::METRES;
    Report::new(text(&report, is_in_metres), report).print_always(run)
}

fn text(report: &InfoReport, is_in_metres: bool) -> String {
    let [dx, dy] = report.cell_size.map(|size| coordinate(size, 1e-5 * size));
    let [width, height] = report.cell_size_m.map(digits);
    let cell = report.cell_size[0].min(report.cell_size[1]);
    let [west, south, east, north] = report.extent.map(|edge| coordinate(edge, cell));
    let mut facts = Facts::default();
    facts.add("file", report.file.as_str());
    facts.add("format", format!("{}, {}", report.format, report.sample));
    facts.add("size", format!("{} columns x {} rows", report.columns, report.rows));
    facts.add(
        "cell",
        match is_in_metres {
            true => format!("{dx} x {dy} m"),
            false => format!("{dx} x {dy} {} ({width} x {height} m)", report.unit),
        },
    );
    facts.add("CRS", report.crs.name.as_str());
    facts.add("extent", format!("x {west} to {east}, y {south} to {north}"));
    facts.add("heights", heights(report).unwrap_or_else(|| "none".into()));
    facts.add("stored in", report.height_unit.as_str());
    facts.add("voids", voids(report));
    facts.add("surface", report.surface.as_str());
    facts.to_string()
}

fn heights(report: &InfoReport) -> Option<String> {
    let InfoReport { min_height_m, max_height_m, mean_height_m, .. } = report;
    let (low, high, mean) = ((*min_height_m)?, (*max_height_m)?, (*mean_height_m)?);
    Some(format!("{low:.1} to {high:.1} m, mean {mean:.1} m"))
}

fn voids(report: &InfoReport) -> String {
    let share = 100.0 * report.void_count as f64 / (report.columns * report.rows) as f64;
    match report.void_count {
        0 => "none".into(),
        1 => format!("1 cell ({share:.1} %)"),
        count => format!("{count} cells ({share:.1} %)"),
    }
}
