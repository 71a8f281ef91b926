//! `ridgeway surface`: the fitted surface, its residuals and derivatives.

use rayon::prelude::*;
use ridgeway::export::Samples;
use ridgeway::plan::{coordinate, describe_fit};
use ridgeway::{Control, HeightJet, HeightSurface};
use serde_json::json;

use crate::args::{Layer, RunArgs, SurfaceArgs};
use crate::failure::Result;
use crate::output::{check_file, write_raster};
use crate::report::{Facts, Report, digits, wrote};
use crate::scenario;

pub(super) fn run(args: &SurfaceArgs, run: &RunArgs, control: &Control) -> Result<()> {
    if let Some(output) = &args.output {
        check_file(output, &["tif", "tiff"], args.overwrite, Some(&args.dem))?;
    }
    let terrain = scenario::open(&args.dem, &args.fit, run)?;
    let surface = scenario::fit(&args.dem, &terrain, &args.fit, control)?;
    if let Some(output) = &args.output {
        let make = |layer: Layer| {
            let surface = &surface;
            move |row: usize, line: &mut [f32]| layer.row(surface, row, line)
        };
        let rows: Vec<_> = args.layers.iter().map(|&layer| (layer, make(layer))).collect();
        let bands: Vec<_> = rows
            .iter()
            .map(|(layer, make)| (layer.description().to_owned(), Samples::F32Rows(make)))
            .collect();
        control.check()?;
        write_raster(output, args.overwrite, terrain.georeference(), &bands)?;
    }
    report(args, &surface).print(run)
}

fn report(args: &SurfaceArgs, surface: &HeightSurface) -> Report {
    let residuals = surface.residuals();
    let at = surface.frame().to_map(residuals.at);
    let cell = surface.frame().step().min_element();
    let [x, y] = at.to_array().map(|value| coordinate(value, cell));
    let fit = describe_fit(&args.fit.options(), surface);
    let mut facts = Facts::default();
    facts.add("surface", fit.as_str());
    facts.add("residuals", format!("{} m root mean square", digits(residuals.rms)));
    facts.add("largest", format!("{} m at {x},{y}", digits(residuals.max)));
    facts.add("curvature", format!("{} 1/m root mean square", digits(surface.rms_curvature())));
    let outputs: Vec<_> = args.output.iter().map(|path| path.display().to_string()).collect();
    let written: String = args.output.iter().map(|path| wrote(path)).collect();
    Report::new(
        facts.to_string() + &written,
        json!({
            "surface": fit,
            "cutoff_m": surface.cutoff(),
            "rms_residual_m": residuals.rms,
            "max_residual_m": residuals.max,
            "max_residual_at": at.to_array(),
            "rms_curvature_per_m": surface.rms_curvature(),
            "outputs": outputs,
        }),
    )
}

impl Layer {
    pub(super) fn description(self) -> &'static str {
        match self {
            Self::Height => "height (m)",
            Self::Slope => "slope (degrees)",
            Self::Gaussian => "Gaussian curvature (1/m2)",
            Self::Mean => "mean curvature (1/m)",
            Self::K1 => "larger principal curvature (1/m)",
            Self::K2 => "smaller principal curvature (1/m)",
        }
    }

    fn of(self, jet: &HeightJet) -> f64 {
        match self {
            Self::Height => jet.z,
            Self::Slope => jet.slope().to_degrees(),
            Self::Gaussian => jet.curvature().gaussian,
            Self::Mean => jet.curvature().mean,
            Self::K1 => jet.curvature().principal[0],
            Self::K2 => jet.curvature().principal[1],
        }
    }

    /// The layer at the nodes of a row; `NaN` at voids.
    fn row(self, surface: &HeightSurface, row: usize, line: &mut [f32]) {
        let mut jets = vec![HeightJet::default(); line.len()];
        surface.row_jets(row, &mut jets);
        for (col, (value, jet)) in line.iter_mut().zip(&jets).enumerate() {
            *value = if surface.is_void(col, row) { f32::NAN } else { self.of(jet) as f32 };
        }
    }

    /// The layer at all nodes, row-major; `NaN` at voids.
    pub(super) fn sample(self, surface: &HeightSurface) -> Vec<f32> {
        let mut values = vec![0.0; surface.frame().nodes()];
        let lines = values.par_chunks_mut(surface.frame().cols()).enumerate();
        lines.for_each(|(row, line)| self.row(surface, row, line));
        values
    }
}
