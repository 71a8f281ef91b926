//! `ridgeway match`: regions of like shape on two surfaces, or on one.

use std::path::Path;

use glam::DVec2;
use image::RgbaImage;
use ridgeway::plan::{MatchReport, MatchedSurface, Scenario};
use ridgeway::region::{
    Level, Match, Neighbours, Signature, match_regions, match_regions_within, outlines, signatures,
};
use ridgeway::render::{
    LogPlot, MapPicture, Mark, RegionLayer, Rgb, SurfacePicture, encode_png, pair_colour,
    side_by_side,
};
use ridgeway::surface::{NurbsGrid, NurbsSurface};
use ridgeway::{Control, Modifiers, Surface, Terrain};

use super::render::title;
use super::segment::{SampledMetric, cut};
use crate::args::{CURVATURE, MatchArgs, RunArgs, metric_named};
use crate::failure::{Failure, Result};
use crate::output::{check_outputs_in, write_contents};
use crate::report::{Report, Table, digits, json, metres, wrote_in};
use crate::scenario::{self, command_line};

const FILES: [&str; 3] = ["matches.json", "regions.png", "signatures.png"];

/// Most pairs that the table names.
const NAMED: usize = 20;

/// Length of the longer side of each surface in `regions.png`.
const PIXELS: u32 = 1000;

pub(super) fn run(args: &MatchArgs, run: &RunArgs, control: &Control) -> Result<()> {
    if let Some(folder) = &args.output {
        check_outputs_in(folder, &FILES, args.overwrite)?;
    }
    let surfaces = args
        .surfaces
        .iter()
        .map(|path| SegmentedSurface::open(path, args, run, control))
        .collect::<Result<Vec<_>>>()?;
    let found = match &surfaces[..] {
        [one] => match_regions_within(&one.signatures, args.sized)?,
        [first, second] => match_regions(&first.signatures, &second.signatures, args.sized)?,
        _ => return Err(Failure::usage("match compares one surface with itself, or two")),
    };
    let records = surfaces.iter().map(SegmentedSurface::record).collect();
    let report = MatchReport::new(records, &found, Some(command_line()));
    if let Some(folder) = &args.output {
        let colours = colours(&surfaces, &found);
        let contents =
            [json(&report).into_bytes(), regions(&surfaces, &colours)?, plot(&surfaces, &colours)?];
        control.check()?;
        write_contents(folder, args.overwrite, &FILES, &contents)?;
    }
    let written = args.output.iter().map(|folder| wrote_in(folder, &FILES));
    let text = table(&surfaces, &found) + &written.collect::<String>();
    Report::new(text, report).print(run)
}

/// A surface cut into regions.
struct SegmentedSurface<'a> {
    path: &'a Path,
    source: Source,
    /// The finest level.
    level: Level,
    signatures: Vec<Signature>,
}

/// What the surface was read from.
enum Source {
    Heights(Box<Scenario>, Box<Terrain>),
    Nurbs(Box<NurbsGrid>),
}

impl<'a> SegmentedSurface<'a> {
    /// Reads a surface and cuts it.
    ///
    /// # Errors
    /// A file that cannot be read or used; a flag that a NURBS surface cannot have.
    fn open(path: &'a Path, args: &'a MatchArgs, run: &RunArgs, control: &Control) -> Result<Self> {
        let is_json = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("json"));
        let (source, sampled) = match is_json {
            true => open_nurbs(path, args, control)?,
            false => open_dem(path, args, run, control)?,
        };
        let surface = source.surface();
        let solver = args.ground.metric_options.solver();
        let mut levels = cut(surface, sampled, &args.regions, solver, control)?.levels;
        let level = levels.pop().unwrap_or_default();
        let signatures = signatures(surface, &level.labels, Neighbours::Surface, control)?;
        Ok(Self { path, source, level, signatures })
    }

    fn record(&self) -> MatchedSurface {
        let signatures = self.signatures.iter().enumerate();
        MatchedSurface::new(self.path, signatures.map(|(i, &signature)| (self.seed(i), signature)))
    }

    /// The regions in their colours.
    fn picture(&self, colours: &[Rgb]) -> ridgeway::Result<RgbaImage> {
        match &self.source {
            Source::Heights(_, terrain) => {
                let outlines = outlines(&self.level, terrain.frame().cols());
                let mut map = MapPicture::new(terrain.frame(), terrain.heights());
                (map.title, map.max_side_px) = (title(self.path), PIXELS);
                map.regions = Some(RegionLayer {
                    labels: &self.level.labels,
                    colours: colours.to_vec(),
                    borders: vec![&outlines],
                    seeds: Vec::new(),
                });
                map.render()
            }
            Source::Nurbs(surface) => {
                let labels = self.level.labels.iter();
                let colours: Vec<_> =
                    labels.map(|l| l.map_or(Rgb::WHITE, |l| colours[l as usize])).collect();
                let mut picture = SurfacePicture::new(&**surface, &colours);
                (picture.title, picture.max_side_px) = (title(self.path), PIXELS);
                (picture.blend, picture.regions) = (false, &self.level.labels);
                picture.render()
            }
        }
    }

    /// The seed of a region: map coordinates on a DEM, else the point in space.
    fn seed(&self, region: usize) -> Vec<f64> {
        let [col, row] = self.level.regions[region].seed;
        let node = DVec2::new(col as f64, row as f64);
        match &self.source {
            Source::Heights(_, terrain) => terrain.frame().to_map(node).to_array().into(),
            Source::Nurbs(surface) => surface.space_jet(node).point.to_array().into(),
        }
    }
}

fn open_nurbs(path: &Path, args: &MatchArgs, control: &Control) -> Result<(Source, SampledMetric)> {
    if let Some(flag) = args.ground.metric_options.dem_only_flag() {
        let name = path.display();
        return Err(Failure::usage(format!("{flag} is for DEMs, and {name} is none")));
    }
    let (cols, rows) = args.nodes;
    let surface = NurbsSurface::open(path)?.on_grid(cols, rows)?;
    let metric = args
        .ground
        .metric_options
        .metric(args.choice.metric.unwrap_or(metric_named(CURVATURE)), None)?;
    let sampled =
        SampledMetric::of(&metric.on(&surface, &Modifiers::default(), control)?, control)?;
    Ok((Source::Nurbs(Box::new(surface)), sampled))
}

fn open_dem(
    path: &Path,
    args: &MatchArgs,
    run: &RunArgs,
    control: &Control,
) -> Result<(Source, SampledMetric)> {
    let name = args.ground.metric_options.chosen(args.choice.metric)?;
    let places = (&[][..], &[][..]);
    let (scenario, terrain) = scenario::prepare(path, places, &args.ground, run, control)?;
    let metric = scenario::bind(&scenario, name, &args.ground, run, control)?;
    let sampled = SampledMetric::of(&metric, control)?;
    drop(metric);
    Ok((Source::Heights(Box::new(scenario), Box::new(terrain)), sampled))
}

impl Source {
    fn surface(&self) -> &dyn Surface {
        match self {
            Self::Heights(scenario, _) => &scenario.surface,
            Self::Nurbs(surface) => &**surface,
        }
    }
}

/// The index of the second surface of a match: that of the only one where it is compared with itself.
fn second(surfaces: &[SegmentedSurface<'_>]) -> usize {
    surfaces.len() - 1
}

/// Colour of each region of each surface: one for the regions of a match.
fn colours(surfaces: &[SegmentedSurface<'_>], found: &[Match]) -> Vec<Vec<Rgb>> {
    let unmatched =
        |surface: &SegmentedSurface<'_>| vec![pair_colour(None); surface.signatures.len()];
    let mut colours: Vec<_> = surfaces.iter().map(unmatched).collect();
    for (rank, pair) in found.iter().enumerate() {
        colours[0][pair.first] = pair_colour(Some(rank));
        colours[second(surfaces)][pair.second] = pair_colour(Some(rank));
    }
    colours
}

/// The surfaces side by side.
fn regions(surfaces: &[SegmentedSurface<'_>], colours: &[Vec<Rgb>]) -> ridgeway::Result<Vec<u8>> {
    let pictures = surfaces.iter().zip(colours).map(|(surface, colours)| surface.picture(colours));
    encode_png(&side_by_side(&pictures.collect::<ridgeway::Result<Vec<_>>>()?)?)
}

/// The two largest eigenvalues of all regions.
fn plot(surfaces: &[SegmentedSurface<'_>], colours: &[Vec<Rgb>]) -> ridgeway::Result<Vec<u8>> {
    let mut plot = LogPlot {
        kinds: surfaces.iter().map(|surface| title(surface.path)).collect(),
        axes: ["λ1".into(), "λ2".into()],
        title: "Signatures; one colour: matched".into(),
        ..LogPlot::default()
    };
    for (kind, (surface, colours)) in surfaces.iter().zip(colours).enumerate() {
        let marks = surface.signatures.iter().zip(colours).enumerate();
        plot.marks.extend(marks.map(|(i, (signature, &colour))| {
            let [x, y, ..] = signature.eigenvalues;
            Mark { at: DVec2::new(x, y), colour, kind, label: (i + 1).to_string() }
        }));
    }
    plot.png()
}

fn table(surfaces: &[SegmentedSurface<'_>], found: &[Match]) -> String {
    let mut text = String::new();
    for surface in surfaces {
        let count = surface.signatures.len();
        let noun = if count == 1 { "region" } else { "regions" };
        text += &format!("{}: {count} {noun}\n", title(surface.path));
    }
    if found.is_empty() {
        let regions: usize = surfaces.iter().map(|surface| surface.signatures.len()).sum();
        return text
            + match regions {
                0 | 1 => "one region alone matches none; cut finer by --epsilon or --levels\n",
                _ => "no pair of regions in which the shape varies; cut coarser by --epsilon\n",
            };
    }
    let mut table = Table::default();
    let header = ["", "first", "second", "unlike", "size", "size", "ratio", "best of all"];
    table.row(header);
    for (i, pair) in found.iter().take(NAMED).enumerate() {
        let size = |k: usize, region: usize| metres(surfaces[k].signatures[region].size);
        table.row([
            (i + 1).to_string(),
            (pair.first + 1).to_string(),
            (pair.second + 1).to_string(),
            format!("{:.3}", pair.distance),
            size(0, pair.first),
            size(second(surfaces), pair.second),
            digits(pair.size_ratio),
            if pair.mutual { "yes" } else { "no" }.to_owned(),
        ]);
    }
    text += &table.to_string();
    if found.len() > NAMED {
        text += &format!("and {} pairs less alike\n", found.len() - NAMED);
    }
    text
}
