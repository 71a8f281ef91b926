//! `ridgeway synth`: synthetic terrains.

use ridgeway::export::Samples;
use ridgeway::synthetic::{Synthetic, SyntheticKind};
use ridgeway::{Control, Crs, Terrain};
use serde_json::json;

use crate::args::{RunArgs, SynthArgs};
use crate::failure::Result;
use crate::output::{check_file, write_raster};
use crate::report::{Facts, Report, wrote};

pub(super) fn run(args: &SynthArgs, run: &RunArgs, control: &Control) -> Result<()> {
    // The parser asks for both unless --list is given.
    let (Some(kind), Some(output), false) = (&args.kind, &args.output, args.list) else {
        return list(run);
    };
    let kind: SyntheticKind = kind.parse()?;
    check_file(output, &["tif", "tiff"], args.overwrite, None)?;
    let terrain = terrain(args, kind, control)?;
    control.check()?;
    let frame = terrain.frame();
    let heights = |row: usize, line: &mut [f32]| {
        let heights = &terrain.heights()[frame.index(0, row)..];
        line.iter_mut().zip(heights).for_each(|(value, &z)| *value = z as f32);
    };
    let bands = [("height (m)".into(), Samples::F32Rows(&heights))];
    write_raster(output, args.overwrite, terrain.georeference(), &bands)?;
    let facts = json!({
        "kind": kind.name(),
        "columns": frame.cols(),
        "rows": frame.rows(),
        "spacing_m": args.spacing,
        "seed": args.seed,
        "crs": terrain.crs().name(),
        "outputs": [output.display().to_string()],
    });
    Report::new(wrote(output), facts).print(run)
}

fn terrain(args: &SynthArgs, kind: SyntheticKind, control: &Control) -> Result<Terrain> {
    let (cols, rows) = args.size;
    let mut synthetic = Synthetic::new(kind, cols, rows, args.spacing)?.with_seed(args.seed);
    if let Some(relief) = args.relief {
        synthetic = synthetic.with_relief(relief)?;
    }
    let crs = args.crs.map_or_else(|| Ok(Crs::none()), Crs::from_epsg)?;
    let metres = crs.ground().metres_per_unit(args.origin.y);
    let to_centre = synthetic.position(cols - 1, 0) / metres;
    Ok(synthetic.terrain_with(crs, args.origin + to_centre, control)?)
}

fn list(run: &RunArgs) -> Result<()> {
    let mut facts = Facts::default();
    for kind in SyntheticKind::ALL {
        facts.add(kind.name(), kind.description());
    }
    let kinds =
        SyntheticKind::ALL.map(|k| json!({ "name": k.name(), "description": k.description() }));
    Report::new(facts.to_string(), kinds).print_always(run)
}
