//! From flags to real things: the terrain, the surface on it, the metrics, and the places.

use std::path::Path;
use std::sync::Arc;

use ridgeway::grid::rasterise;
use ridgeway::metric::NamedMetric;
use ridgeway::terrain::{Georeference, read_bands};
use ridgeway::{
    Control, DistanceMap, Error, GridFrame, HeightSurface, Metric, MetricField, Modifiers, Result,
    Smoothing, StartRegion, Stop, Sym2, Terrain,
};
use serde_json::{Value, json};

use crate::args::{FitArgs, GroundArgs, RunArgs, TENSOR};
use crate::places::{self, Place, Spot, cell};
use crate::report::{self, digits};

/// Everything that lies between a start and its goals, but the metric.
pub(crate) struct Journey<'a> {
    args: &'a GroundArgs,
    pub(crate) control: &'a Control,
    dem: &'a Path,
    pub(crate) georeference: Georeference,
    pub(crate) surface: HeightSurface,
    /// One for each `--start`.
    pub(crate) regions: Vec<StartRegion>,
    pub(crate) starts: Vec<Spot>,
    pub(crate) goals: Vec<Spot>,
    start_names: Vec<String>,
    barrier: Option<Arc<[bool]>>,
    tensors: Option<Arc<[Sym2]>>,
    cost: Option<Arc<[f32]>>,
    quiet: bool,
}

impl<'a> Journey<'a> {
    /// Reads the DEM and the files named by flags, puts the places on the grid, and fits the surface. The terrain is for
    /// those who draw its relief; others drop it, and its memory.
    ///
    /// # Errors
    /// Any input that cannot be read or used; a place outside the DEM, on a void or on a barrier.
    pub(crate) fn prepare(
        dem: &'a Path,
        (start, goal): (&[Place], &[Place]),
        args: &'a GroundArgs,
        run: &RunArgs,
        control: &'a Control,
    ) -> Result<(Self, Terrain)> {
        let terrain = open(dem, run)?;
        let barrier = barrier(args, &terrain)?;
        let (regions, starts) = places::regions("--start", start, &terrain)?;
        let goals = places::points("--goal", goal, &terrain)?;
        check_open(&terrain, barrier.as_deref(), &regions, starts.iter().chain(&goals))?;
        let tensors = match &args.metric.tensor {
            Some(path) => Some(tensors(path, &terrain)?),
            None => None,
        };
        let cost = match &args.metric.cost {
            Some(path) => Some(costs(path, &terrain)?),
            None => None,
        };
        let surface = fit(dem, &terrain, &args.fit, control)?;
        let start_names = start.iter().map(Place::to_string).collect();
        let journey = Self {
            args,
            control,
            dem,
            georeference: terrain.georeference().clone(),
            surface,
            regions,
            starts,
            goals,
            start_names,
            barrier,
            tensors,
            cost,
            quiet: run.quiet,
        };
        Ok((journey, terrain))
    }

    /// The metric of this name.
    ///
    /// # Errors
    /// `tensor` without `--tensor`.
    pub(crate) fn metric(&self, metric: NamedMetric) -> Result<Box<dyn Metric>> {
        self.args.metric.metric(metric, self.tensors.as_ref())
    }

    /// The metric of this name on the surface.
    ///
    /// # Errors
    /// `tensor` without `--tensor`; a start or goal where the metric lets nobody enter; cancelled.
    pub(crate) fn field(&self, metric: NamedMetric, control: &Control) -> Result<MetricField<'_>> {
        let modifiers = Modifiers {
            climb_weight: self.args.metric.climb_weight,
            max_slope_deg: self.args.metric.max_slope,
            barrier: self.barrier.clone(),
            cost: self.cost.clone(),
        };
        let field = self.metric(metric)?.on(&self.surface, &modifiers, control)?;
        for spot in self.starts.iter().chain(&self.goals) {
            let why = match (metric.name, self.args.metric.max_slope) {
                _ if self.cost.is_some() => {
                    "lies where the metric lets nobody enter: --cost or --tensor has no \
                     value there, or the ground is steeper than --max-slope allows"
                }
                (TENSOR, Some(_)) => {
                    "lies where --tensor has no value or the ground is steeper than --max-slope allows"
                }
                (_, Some(_)) => "lies on ground steeper than --max-slope allows",
                (TENSOR, None) => "lies where --tensor has no value",
                (_, None) => "lies where the metric is too extreme to compute with",
            };
            spot.check(&self.georeference, |col, row| field.is_open(col, row), why)?;
        }
        self.note_climb_weight(&field);
        Ok(field)
    }

    /// Says so where the climb weight makes the metric more anisotropic than the grid can follow.
    fn note_climb_weight(&self, field: &MetricField<'_>) {
        /// A grade of 60 % is then 19 times as costly as level ground. Across Andorra (75 m cells) the distance is 9 % too short at 1800,
        /// 36 % at 6000.
        const LARGEST: f64 = 1000.0;
        let weight = self.args.metric.climb_weight;
        if let Some(level) = field.level()
            && weight > LARGEST * level
            && !self.quiet
        {
            eprintln!(
                "note: --climb-weight {weight} is more than 1000 times what level ground costs on the {} metric, {}: \
                 distances come out far too short; 100 times would be {}",
                field.name(),
                digits(level),
                digits(100.0 * level)
            );
        }
    }

    /// No farther than the goals.
    pub(crate) fn all_goals(&self) -> Stop {
        Stop::AllGoals(self.goals.iter().map(|goal| goal.at).collect())
    }

    /// Distance from the nearest start.
    ///
    /// # Errors
    /// [`Error::NoWay`] if a goal cannot be reached: the message names the nearest place that can.
    pub(crate) fn solve(&self, field: &MetricField<'_>, stop: &Stop) -> Result<DistanceMap> {
        let distance = self.args.metric.solver().solve(field, &self.regions, stop, self.control)?;
        for goal in &self.goals {
            if distance.at(goal.at).is_none() {
                let reached = |col, row| distance.at_node(col, row).is_finite();
                let why = "cannot be reached from the start: voids, barriers or too steep ground lie between";
                return Err(Error::NoWay(goal.refusal(&self.georeference, reached, why)?));
            }
        }
        Ok(distance)
    }

    /// Cells with a height that `field` lets nobody enter, row-major.
    pub(crate) fn barriers(&self, field: &MetricField<'_>) -> Vec<bool> {
        let frame = self.georeference.frame();
        let nodes = (0..frame.rows()).flat_map(|row| (0..frame.cols()).map(move |col| (col, row)));
        nodes.map(|(c, r)| !field.is_open(c, r) && !self.surface.is_void(c, r)).collect()
    }

    /// For [`Error::NoWay`], which metrics' distances end before the goal and where; else the error.
    ///
    /// # Errors
    /// Always: the best account there is.
    pub(crate) fn explain<T>(&self, error: Error, fields: &[MetricField<'_>]) -> Result<T> {
        if let Error::NoPath { .. } | Error::NoWay(_) = error {
            for field in fields {
                self.solve(field, &Stop::Never)?;
            }
        }
        Err(error)
    }

    /// All that is needed to make the run again, for the files it writes.
    pub(crate) fn provenance(&self, fields: &[MetricField<'_>]) -> Value {
        let metric = &self.args.metric;
        let name =
            |path: &Path| path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let metrics: Vec<_> = fields.iter().map(report::metric).collect();
        json!({
            "metrics": metrics,
            "software": format!("ridgeway {}", env!("CARGO_PKG_VERSION")),
            "command": command_line(),
            "dem": name(self.dem),
            "surface": describe_fit(&self.args.fit, &self.surface),
            "cutoff_m": self.surface.cutoff(),
            "climb_weight": metric.climb_weight,
            "max_slope_deg": metric.max_slope,
            "barriers": metric.barrier.iter().map(|path| name(path)).collect::<Vec<_>>(),
            "cost": metric.cost.as_deref().map(name),
            "tensor": metric.tensor.as_deref().map(name),
            "accuracy": metric.accuracy.name(),
            "start": self.start_names,
            "goal": self.goals.iter().map(|goal| &goal.name).collect::<Vec<_>>(),
        })
    }
}

/// Reads the DEM and tells what its reader noticed.
pub(crate) fn open(dem: &Path, run: &RunArgs) -> Result<Terrain> {
    let terrain = Terrain::open(dem)?;
    report::notes(&terrain, run);
    Ok(terrain)
}

/// Fits the surface; an error names the DEM.
pub(crate) fn fit(
    dem: &Path,
    terrain: &Terrain,
    args: &FitArgs,
    control: &Control,
) -> Result<HeightSurface> {
    HeightSurface::fit(terrain, &args.options(), control).map_err(|error| error.in_file(dem))
}

/// The surface that was fitted, in words.
pub(crate) fn describe_fit(args: &FitArgs, surface: &HeightSurface) -> String {
    let how = match (args.options().smoothing, surface.cutoff()) {
        (Smoothing::Interpolate, _) => "through every height".into(),
        (Smoothing::Tolerance(tolerance), _) => format!("within {tolerance} m (root mean square)"),
        (Smoothing::Auto, Some(cutoff)) => {
            format!("cut-off {} by cross-validation", report::metres(cutoff))
        }
        (_, Some(cutoff)) => format!("cut-off {}", report::metres(cutoff)),
        (_, None) => "smoothed".into(),
    };
    format!("{} B-spline, {how}", args.degree.name())
}

/// The cells of `--barrier`, if there are any.
fn barrier(args: &GroundArgs, terrain: &Terrain) -> Result<Option<Arc<[bool]>>> {
    let mut cells: Option<Vec<bool>> = None;
    for path in &args.metric.barrier {
        let shapes = places::read_shapes(path, terrain.georeference())?;
        let touched = rasterise(terrain.frame(), &shapes);
        match &mut cells {
            Some(cells) => cells.iter_mut().zip(touched).for_each(|(cell, more)| *cell |= more),
            None => cells = Some(touched),
        }
    }
    Ok(cells.map(Arc::from))
}

/// Checks that points lie on, and that every start of lines and areas touches, open ground.
fn check_open<'s>(
    terrain: &Terrain,
    barrier: Option<&[bool]>,
    regions: &[StartRegion],
    spots: impl Iterator<Item = &'s Spot>,
) -> Result<()> {
    let closed = |col, row| barrier.is_some_and(|cells| cells[terrain.frame().index(col, row)]);
    let open = |col, row| !terrain.is_void(col, row) && !closed(col, row);
    for spot in spots {
        let (col, row) = cell(spot.at);
        let why = match terrain.is_void(col, row) {
            true => "lies on a void of the DEM",
            false => "lies on a barrier",
        };
        spot.check(terrain.georeference(), open, why)?;
    }
    for region in regions.iter().filter(|region| region.shapes.points.is_empty()) {
        let touched = rasterise(terrain.frame(), &region.shapes);
        let cols = terrain.frame().cols();
        let any = touched.iter().enumerate().any(|(i, &t)| t && open(i % cols, i / cols));
        if !any {
            return Err(Error::usage(
                "--start: its lines and areas touch no open cell of the DEM; the file must be in \
                 longitude and latitude (RFC 7946) and overlap the DEM",
            ));
        }
    }
    Ok(())
}

/// The speed tensors of a three-band raster on the grid of the terrain.
fn tensors(path: &Path, terrain: &Terrain) -> Result<Arc<[Sym2]>> {
    let raster = read_bands(path)?;
    let [xx, xy, yy] = &raster.bands[..] else {
        let found = match raster.bands.len() {
            1 => "1 band".into(),
            bands => format!("{bands} bands"),
        };
        return Err(Error::format(
            path,
            format!("has {found}; a tensor raster has three: D11, D12, D22"),
        ));
    };
    check_grid(path, &raster.frame, terrain.frame())?;
    Ok(xx.iter().zip(xy).zip(yy).map(|((&xx, &xy), &yy)| Sym2 { xx, xy, yy }).collect())
}

/// The costs of a one-band raster on the grid of the terrain.
fn costs(path: &Path, terrain: &Terrain) -> Result<Arc<[f32]>> {
    let raster = read_bands(path)?;
    let [cost] = &raster.bands[..] else {
        let found = raster.bands.len();
        return Err(Error::format(path, format!("has {found} bands; a cost raster has one")));
    };
    check_grid(path, &raster.frame, terrain.frame())?;
    Ok(cost.iter().map(|&cost| cost as f32).collect())
}

fn check_grid(path: &Path, theirs: &GridFrame, ours: &GridFrame) -> Result<()> {
    let apart = (theirs.origin() - ours.origin()).abs().max((theirs.step() - ours.step()).abs());
    if (theirs.cols(), theirs.rows()) != (ours.cols(), ours.rows())
        || apart.max_element() > 0.01 * ours.step().min_element()
    {
        return Err(Error::format(
            path,
            format!(
                "its grid of {} x {} cells from {},{} is not the DEM's of {} x {} cells from {},{}; \
                 resample it to the DEM, for example with gdalwarp -te -ts",
                theirs.cols(),
                theirs.rows(),
                theirs.origin().x,
                theirs.origin().y,
                ours.cols(),
                ours.rows(),
                ours.origin().x,
                ours.origin().y
            ),
        ));
    }
    Ok(())
}

/// The command line, quoted for a shell.
pub(crate) fn command_line() -> String {
    std::env::args_os()
        .enumerate()
        .map(|(i, word)| match i {
            0 => "ridgeway".into(),
            _ => quoted(&word.to_string_lossy()),
        })
        .collect::<Vec<_>>()
        .join(" ")
}

fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_alphanumeric() || "-_=+./,:%@".contains(c);
    if !word.is_empty() && word.chars().all(plain) {
        word.into()
    } else {
        format!("'{}'", word.replace('\'', r"'\''"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_are_quoted_for_a_shell() {
        assert_eq!(quoted("--start=-3,4"), "--start=-3,4");
        assert_eq!(quoted("my dem.tif"), "'my dem.tif'");
        assert_eq!(quoted("it's"), r"'it'\''s'");
        assert_eq!(quoted(""), "''");
    }
}
