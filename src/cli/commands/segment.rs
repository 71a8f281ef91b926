//! `ridgeway segment`: regions of like shape.

use geo_types::MultiPolygon;
use glam::DVec2;
use ridgeway::eikonal::TensorField;
use ridgeway::export::{Samples, regions_geojson};
use ridgeway::plan::{Provenance, RegionRecord, Scenario, SegmentReport, coordinate};
use ridgeway::region::{
    Level, Neighbours, RegionStatistics, Segmentation, Signature, outlines, region_statistics,
    signatures,
};
use ridgeway::render::{MapPicture, RegionLayer, contrasting_colours};
use ridgeway::{Control, HeightSurface, MetricField, Solver, Surface, Terrain};

use super::render::title;
use crate::args::{RegionArgs, RunArgs, SegmentArgs};
use crate::failure::Result;
use crate::output::{check_distinct, check_file, write_content, write_raster};
use crate::report::{Facts, Report, Table, digits, distance, wrote_on};
use crate::scenario::{self, command_line};

/// Most regions of a level that the table names.
const NAMED: usize = 20;

pub(super) fn run(args: &SegmentArgs, run: &RunArgs, control: &Control) -> Result<()> {
    check_distinct(&args.output.iter().collect::<Vec<_>>())?;
    let known = ["geojson", "json", "tif", "tiff", "png"];
    let formats = args
        .output
        .iter()
        .map(|path| check_file(path, &known, args.overwrite, Some(&args.dem)))
        .collect::<Result<Vec<_>>>()?;
    let name = args.ground.metric_options.chosen(args.choice.metric)?;
    let places = (&[][..], &[][..]);
    let (scenario, terrain) = scenario::prepare(&args.dem, places, &args.ground, run, control)?;
    let relief = formats.iter().any(|format| format == "png").then_some(terrain);
    let metric = scenario::bind(&scenario, name, &args.ground, run, control)?;
    let sampled = SampledMetric::of(&metric, control)?;
    let (regions, solver) = (&args.regions, args.ground.metric_options.solver());
    let segmentation = cut(&scenario.surface, sampled, regions, solver, control)?;
    let measures = measures(&segmentation, &scenario.surface, control)?;
    let result = Regions { scenario: &scenario, metric: &metric, segmentation, measures };
    control.check()?;
    let provenance = scenario.provenance(std::slice::from_ref(&metric), Some(command_line()));
    for (path, format) in args.output.iter().zip(&formats) {
        match (format.as_str(), &relief) {
            ("png", Some(terrain)) => {
                let picture = result.picture(terrain, title(&args.dem))?;
                write_content(path, args.overwrite, &picture)?;
            }
            ("tif" | "tiff", _) => result.write_labels(path, args.overwrite)?,
            _ => write_content(path, args.overwrite, &result.polygons(&provenance)?)?,
        }
    }
    let written: String =
        args.output.iter().map(|path| wrote_on(path, scenario.georeference.crs())).collect();
    let report = SegmentReport {
        metric: metric.name().to_owned(),
        unit: metric.unit(),
        delta_per_m: metric.parameter("delta_per_m"),
        regions: result.records().collect(),
        provenance,
    };
    Report::new(result.text() + &written, report).print(run)
}

/// A metric at the nodes of a surface, and the order in which these are tried as seeds.
pub(super) struct SampledMetric {
    ranks: Vec<f64>,
    field: TensorField,
}

impl SampledMetric {
    pub(super) fn of(metric: &MetricField<'_>, control: &Control) -> ridgeway::Result<Self> {
        Ok(Self { ranks: metric.seed_ranks(), field: TensorField::sample(metric, control)? })
    }
}

/// Cuts a surface as the flags ask.
///
/// # Errors
/// Radii that do not fall; too many or no regions; cancelled.
pub(super) fn cut(
    surface: &dyn Surface,
    SampledMetric { ranks, field }: SampledMetric,
    regions: &RegionArgs,
    solver: Solver,
    control: &Control,
) -> ridgeway::Result<Segmentation> {
    let mut segmentation = Segmentation::of(&field, &ranks, &regions.options(solver), control)?;
    drop((field, ranks));
    if let Some(tolerance) = regions.merge {
        segmentation.merge_similar(surface, tolerance, control)?;
    }
    Ok(segmentation)
}

/// Statistics and signature of each region of each level.
fn measures(
    segmentation: &Segmentation,
    surface: &HeightSurface,
    control: &Control,
) -> ridgeway::Result<Vec<Vec<(RegionStatistics, Signature)>>> {
    let levels = segmentation.levels.iter();
    levels.map(|level| measures_of_level(level, surface, control)).collect()
}

fn measures_of_level(
    level: &Level,
    surface: &HeightSurface,
    control: &Control,
) -> ridgeway::Result<Vec<(RegionStatistics, Signature)>> {
    control.report("measuring", 0.0);
    let signatures = signatures(surface, &level.labels, Neighbours::Surface, control)?;
    Ok(region_statistics(surface, level).into_iter().zip(signatures).collect())
}

/// Regions with their statistics and signatures.
struct Regions<'a> {
    scenario: &'a Scenario,
    metric: &'a MetricField<'a>,
    segmentation: Segmentation,
    measures: Vec<Vec<(RegionStatistics, Signature)>>,
}

impl Regions<'_> {
    /// The regions of each level in order.
    fn records(&self) -> impl Iterator<Item = RegionRecord> + '_ {
        let levels = self.segmentation.levels.iter().zip(&self.measures).enumerate();
        levels.flat_map(move |(depth, (level, measures))| {
            let regions = level.regions.iter().zip(measures).enumerate();
            regions.map(move |(i, (region, measures))| {
                let seed = self.scenario.frame().to_map(node(region.seed)).to_array();
                RegionRecord::new([depth, i], region, seed, measures, self.metric.unit())
            })
        })
    }

    fn outlines(&self) -> Vec<Vec<MultiPolygon<f64>>> {
        let levels = self.segmentation.levels.iter();
        levels.map(|level| outlines(level, self.segmentation.cols)).collect()
    }

    fn polygons(&self, provenance: &Provenance) -> Result<Vec<u8>> {
        let regions: Vec<_> = self.records().zip(self.outlines().into_iter().flatten()).collect();
        let on = &self.scenario.georeference;
        Ok(regions_geojson(&regions, on.frame(), on.crs(), provenance)?.into_bytes())
    }

    fn write_labels(&self, path: &std::path::Path, overwrite: bool) -> Result<()> {
        let levels: Vec<_> = self.segmentation.levels.iter().map(numbers).collect();
        let bands: Vec<_> = (1..)
            .zip(&levels)
            .map(|(depth, numbers)| (format!("region of level {depth}"), Samples::U32(numbers)))
            .collect();
        Ok(write_raster(path, overwrite, &self.scenario.georeference, &bands)?)
    }

    fn picture(&self, terrain: &Terrain, title: String) -> Result<Vec<u8>> {
        let outlines = self.outlines();
        let mut map = MapPicture::new(terrain.frame(), terrain.heights());
        map.title = title;
        if let Some(finest) = self.segmentation.levels.last() {
            let count = finest.regions.len();
            map.regions = Some(RegionLayer {
                labels: &finest.labels,
                colours: contrasting_colours(&finest.labels, self.segmentation.cols, count),
                borders: outlines.iter().map(Vec::as_slice).collect(),
                seeds: finest.regions.iter().map(|region| node(region.seed)).collect(),
            });
        }
        Ok(map.png()?)
    }

    fn text(&self) -> String {
        let mut text = String::new();
        for (depth, (level, measures)) in
            self.segmentation.levels.iter().zip(&self.measures).enumerate()
        {
            let mut facts = Facts::default();
            let count = level.regions.len();
            let noun = if count == 1 { "region" } else { "regions" };
            facts.add(format!("level {}", depth + 1), format!("{count} {noun}"));
            facts.add("epsilon", self.epsilons(level));
            text += &facts.to_string();
            text += &self.table(level, measures).to_string();
            if count > NAMED {
                text += &format!("and {} smaller ones\n", count - NAMED);
            }
        }
        text
    }

    /// The radius of the clusters, or the range of radii.
    fn epsilons(&self, level: &Level) -> String {
        let all = level.regions.iter().map(|region| region.epsilon);
        let (least, most) =
            all.fold((f64::INFINITY, 0.0), |(a, b), e| (f64::min(a, e), f64::max(b, e)));
        let unit = self.metric.unit();
        if least < most {
            format!("{} to {}", distance(least, unit), distance(most, unit))
        } else {
            distance(most, unit)
        }
    }

    /// The largest regions of a level.
    fn table(&self, level: &Level, measures: &[(RegionStatistics, Signature)]) -> Table {
        let mut order: Vec<usize> = (0..measures.len()).collect();
        order.sort_by(|&a, &b| measures[b].0.area_m2.total_cmp(&measures[a].0.area_m2));
        let mut table = Table::default();
        table.row(["region", "of", "cells", "area", "slope", "|κ1|, 1/m", "|κ2|, 1/m", "seed"]);
        let cell = self.scenario.frame().step().min_element();
        for &i in order.iter().take(NAMED) {
            let (region, m) = (&level.regions[i], &measures[i].0);
            let [larger, smaller] = m.mean_abs_curvature_per_m.map(digits);
            let seed = self.scenario.frame().to_map(node(region.seed));
            let [x, y] = seed.to_array().map(|value| coordinate(value, cell));
            table.row([
                (i + 1).to_string(),
                region.parent.map_or(String::new(), |parent| (parent + 1).to_string()),
                m.nodes.to_string(),
                area(m.area_m2),
                format!("{:.1}°", m.mean_slope_deg),
                larger,
                smaller,
                format!("{x},{y}"),
            ]);
        }
        table
    }
}

/// The number of the region of each node, from 1; 0 for none.
fn numbers(level: &Level) -> Vec<u32> {
    level.labels.iter().map(|label| label.map_or(0, |label| label + 1)).collect()
}

/// An area with its unit: `823 m²`, `12.34 km²`.
fn area(square_metres: f64) -> String {
    if square_metres >= 1e5 {
        format!("{} km²", digits(square_metres * 1e-6))
    } else {
        format!("{} m²", digits(square_metres))
    }
}

/// Grid coordinates of a node.
fn node([col, row]: [usize; 2]) -> DVec2 {
    DVec2::new(col as f64, row as f64)
}
