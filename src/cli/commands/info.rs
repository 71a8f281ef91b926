//! `ridgeway info`: what a DEM holds.

use ridgeway::{Ground, Result, Smoothing, Terrain};
use serde_json::json;

use crate::args::{InfoArgs, RunArgs};
use crate::plan;
use crate::report::{Facts, Report, coordinate, digits, metres};

pub(super) fn run(args: &InfoArgs, run: &RunArgs) -> Result<()> {
    let terrain = plan::open(&args.dem, run)?;
    let report = Report { text: text(args, &terrain), json: machine(args, &terrain) };
    report.print_always(run)
}

fn text(args: &InfoArgs, terrain: &Terrain) -> String {
    let (frame, crs, source) = (terrain.frame(), terrain.crs(), terrain.source());
    let (step, ground) = (frame.step(), frame.mid_spacing());
    let (voids, heights) = terrain.statistics();
    let cell = step.min_element();
    let [west, south, east, north] = extent(terrain).map(|edge| coordinate(edge, cell));
    let [dx, dy] = step.to_array().map(|size| coordinate(size, 1e-5 * size));
    let mut facts = Facts::default();
    facts.add("file", args.dem.display().to_string());
    facts.add("format", format!("{}, {}", source.format, source.sample));
    facts.add("size", format!("{} columns x {} rows", frame.cols(), frame.rows()));
    facts.add(
        "cell",
        if crs.ground() == Ground::METRES {
            format!("{dx} x {dy} m")
        } else {
            let (width, height) = (digits(ground.x), digits(ground.y));
            format!("{dx} x {dy} {} ({width} x {height} m)", crs.unit())
        },
    );
    facts.add("CRS", crs.name());
    facts.add("extent", format!("x {west} to {east}, y {south} to {north}"));
    facts.add(
        "heights",
        match heights {
            Some([low, high, mean]) => format!("{low:.1} to {high:.1} m, mean {mean:.1} m"),
            None => "none".into(),
        },
    );
    facts.add("stored in", source.height_unit.clone());
    let share = 100.0 * voids as f64 / frame.nodes() as f64;
    facts.add(
        "voids",
        match voids {
            0 => "none".into(),
            1 => format!("1 cell ({share:.1} %)"),
            _ => format!("{voids} cells ({share:.1} %)"),
        },
    );
    facts.add("surface", planned_fit(args, terrain));
    facts.to_string()
}

fn machine(args: &InfoArgs, terrain: &Terrain) -> serde_json::Value {
    let (frame, crs, source) = (terrain.frame(), terrain.crs(), terrain.source());
    let (voids, heights) = terrain.statistics();
    let ground = frame.mid_spacing();
    json!({
        "file": args.dem.display().to_string(),
        "format": source.format,
        "sample": source.sample,
        "columns": frame.cols(),
        "rows": frame.rows(),
        "cell_size": frame.step().to_array(),
        "cell_size_m": ground.to_array(),
        "crs": { "name": crs.name(), "epsg": crs.epsg() },
        "unit": crs.unit(),
        "extent": extent(terrain),
        "height_unit": source.height_unit,
        "metres_per_height_unit": source.metres_per_height_unit,
        "nodata": source.nodata,
        "south_up": source.south_up,
        "void_count": voids,
        "min_height_m": heights.map(|h| h[0]),
        "max_height_m": heights.map(|h| h[1]),
        "mean_height_m": heights.map(|h| h[2]),
        "surface": planned_fit(args, terrain),
        "notes": terrain.notes(),
    })
}

/// West, south, east and north border of the outermost cells, in map units.
fn extent(terrain: &Terrain) -> [f64; 4] {
    let frame = terrain.frame();
    let half = 0.5 * frame.step();
    let size = frame.step() * glam::DVec2::new(frame.cols() as f64, frame.rows() as f64);
    let (west, north) = (frame.origin().x - half.x, frame.origin().y + half.y);
    [west, north - size.y, west + size.x, north]
}

/// The surface that the other commands would fit with these flags.
fn planned_fit(args: &InfoArgs, terrain: &Terrain) -> String {
    let how = match args.fit.options().smoothing {
        Smoothing::Interpolate => "through every height".into(),
        Smoothing::Cutoff(length) => format!("cut-off {}", metres(length)),
        Smoothing::CutoffCells(cells) => {
            let cell = terrain.frame().mid_spacing();
            let length = cells * (cell.x * cell.y).sqrt();
            format!("cut-off {cells} cells = {}", metres(length))
        }
        Smoothing::Auto => "cut-off by cross-validation".into(),
        Smoothing::Tolerance(rms) => format!("within {rms} m (root mean square)"),
    };
    format!("{} B-spline, {how}", args.fit.degree.name())
}
