//! `ridgeway render`: pictures.

use std::path::Path;

use ridgeway::grid::{Isoline, isolines, levels_by_step, round_step};
use ridgeway::plan::Scenario;
use ridgeway::render::{FieldPicture, Gradient, IsolineLayer, MapPicture, Rgb, RouteLayer};
use ridgeway::{Control, DistanceMap, GridFrame, MetricField, Route, Stop, Terrain, Unit};
use serde_json::json;

use crate::args::{Layer, Picture, RenderArgs, RunArgs};
use crate::failure::{Failure, Result};
use crate::output::{check_file, write_content};
use crate::report::{Report, distance, metres, wrote};
use crate::scenario;

/// Isolines of each distance on a map.
const ISOLINES: usize = 20;

pub(super) fn run(args: &RenderArgs, run: &RunArgs, control: &Control) -> Result<()> {
    check_file(&args.output, &["png"], args.overwrite, Some(&args.dem))?;
    let png = match args.layer.field() {
        None if args.start.is_empty() => relief(args, run, control)?,
        None => routes(args, run, control)?,
        Some(_) if !args.start.is_empty() => {
            return Err(Failure::usage(
                "routes are drawn on the hillshade only; leave --layer out",
            ));
        }
        Some(layer) => field(layer, args, run, control)?,
    };
    control.check()?;
    write_content(&args.output, args.overwrite, &png)?;
    let outputs = [args.output.display().to_string()];
    Report::new(wrote(&args.output), json!({ "outputs": outputs })).print(run)
}

fn relief(args: &RenderArgs, run: &RunArgs, control: &Control) -> Result<Vec<u8>> {
    let terrain = scenario::open(&args.dem, &args.ground.fit, run)?;
    let mut map = MapPicture::new(terrain.frame(), terrain.heights());
    map.title = title(&args.dem);
    map.max_side_px = args.width;
    map.control = control.clone();
    Ok(map.png()?)
}

fn field(layer: Layer, args: &RenderArgs, run: &RunArgs, control: &Control) -> Result<Vec<u8>> {
    let terrain = scenario::open(&args.dem, &args.ground.fit, run)?;
    let surface = scenario::fit(&args.dem, &terrain, &args.ground.fit, control)?;
    let values = layer.sample(&surface);
    let gradient = match layer {
        Layer::Height | Layer::Slope => Gradient::Sequential,
        _ => Gradient::Diverging,
    };
    let mut picture = FieldPicture::new(terrain.frame(), &values, gradient, layer.description());
    picture.title = title(&args.dem);
    picture.max_side_px = args.width;
    picture.control = control.clone();
    Ok(picture.png()?)
}

fn routes(args: &RenderArgs, run: &RunArgs, control: &Control) -> Result<Vec<u8>> {
    let name = args.ground.metric_options.chosen(args.metric)?;
    let places = (&args.start[..], &args.goal[..]);
    let (scenario, terrain) = scenario::prepare(&args.dem, places, &args.ground, run, control)?;
    let fields = [scenario::bind(&scenario, name, &args.ground, run, control)?];
    let distances = [scenario
        .solve(&fields[0], &Stop::Never, control)
        .map_err(Failure::naming_goals(&scenario))?];
    let routes = scenario.routes_on(&distances[0], &fields[0], control)?;
    map((&scenario, &terrain), &fields, &routes, &distances, args.width, control)
}

/// A map of the terrain, the distances under `fields`, and routes of any of these metrics, to one goal or one to each.
pub(super) fn map(
    (scenario, terrain): (&Scenario, &Terrain),
    fields: &[MetricField<'_>],
    routes: &[Route],
    distances: &[DistanceMap],
    width: u32,
    control: &Control,
) -> Result<Vec<u8>> {
    let frame = terrain.frame();
    let barriers = scenario.closed_nodes(&fields[0]);
    let lines = distances
        .iter()
        .map(|distances| equidistant(frame, distances))
        .collect::<ridgeway::Result<Vec<_>>>()?;
    let mut map = MapPicture::new(frame, terrain.heights());
    map.barriers = &barriers;
    map.title = title(&scenario.question.dem);
    map.max_side_px = width;
    map.control = control.clone();
    map.starts = scenario.starts.iter().map(|start| start.at).collect();
    map.goals = scenario.goals.iter().map(|goal| goal.at).collect();
    for (field, (step, isolines)) in fields.iter().zip(&lines) {
        let label = format!("{} distance, every {step} {}", field.name(), field.unit());
        map.isolines.push(IsolineLayer { isolines, colour: colour(field.name()), label });
    }
    for (i, route) in routes.iter().enumerate() {
        let s = &route.summary;
        let length = metres(s.length_m);
        let goal = match scenario.goals.len() {
            1 => String::new(),
            _ => format!(" to {}", i + 1),
        };
        let label = match s.cost_unit {
            Unit::Metres => format!("{} route{goal}: {length}", s.metric),
            unit => format!("{} route{goal}: {length}, {}", s.metric, distance(s.cost, unit)),
        };
        map.routes.push(RouteLayer { grid: &route.grid, colour: colour(&s.metric), label });
    }
    Ok(map.png()?)
}

/// About twenty isolines at round distances, and their step.
fn equidistant(frame: &GridFrame, distance: &DistanceMap) -> ridgeway::Result<(f64, Vec<Isoline>)> {
    let values = distance.to_row_major();
    distance.check()?;
    let largest = values.iter().filter(|v| v.is_finite()).fold(0f32, |a, &b| a.max(b));
    let step = round_step(largest.into(), ISOLINES);
    let levels = levels_by_step(&values, step)?;
    Ok((step, isolines(frame, &values, &levels)?))
}

fn colour(metric: &str) -> Rgb {
    match metric {
        "isotropic" => Rgb::BLUE,
        "curvature" => Rgb::ORANGE,
        "difference" => Rgb::MAGENTA,
        _ => Rgb::INK,
    }
}

pub(super) fn title(dem: &Path) -> String {
    dem.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

impl Picture {
    /// The field it shows; `None` for the shaded relief.
    fn field(self) -> Option<Layer> {
        match self {
            Self::Hillshade => None,
            Self::Height => Some(Layer::Height),
            Self::Slope => Some(Layer::Slope),
            Self::Mean => Some(Layer::Mean),
            Self::Gaussian => Some(Layer::Gaussian),
        }
    }
}
