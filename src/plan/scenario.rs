//! A question on its ground, ready for any metric.

use std::sync::Arc;

use geo_types::Polygon;
use glam::DVec2;
use rayon::prelude::*;

use super::geometry::read_geojson;
use super::place::Place;
use super::question::Question;
use super::rasters::{read_costs, read_tensors};
use super::site::{Site, locate, nearest};
use crate::control::Control;
use crate::eikonal::{DistanceMap, StartRegion, Stop};
use crate::error::{Error, Location, Obstacle, PlaceError, PlaceErrorKind, Result, Role};
use crate::grid::{GridFrame, Shapes, rasterise};
use crate::linalg::Sym2;
use crate::metric::{Metric, MetricField, Modifiers};
use crate::route::{Comparison, Route, trace};
use crate::surface::HeightSurface;
use crate::terrain::{Georeference, Terrain};

/// A question whose files are read and whose places lie on the grid: all that distances and routes need, but the metric.
#[derive(Clone, Debug)]
pub struct Scenario {
    /// What was asked.
    pub question: Question,
    /// Where the grid lies.
    pub georeference: Georeference,
    /// The surface fitted to the DEM.
    pub surface: HeightSurface,
    /// Where distance is zero: a region for each start of the question.
    pub regions: Vec<StartRegion>,
    /// The points of the starts.
    pub starts: Vec<Site>,
    /// The points of the goals.
    pub goals: Vec<Site>,
    /// What the user should know of the files that were read, such as a barrier that lies outside the grid.
    pub notes: Vec<String>,
    barrier: Option<Arc<[bool]>>,
    tensors: Option<Arc<[Sym2]>>,
    cost: Option<Arc<[f32]>>,
}

impl Question {
    /// Reads the DEM and all else that is named, puts the places on the grid, and fits the surface.
    ///
    /// # Errors
    /// Those of [`Terrain::open`] and [`Scenario::on`].
    pub fn prepare(self, control: &Control) -> Result<Scenario> {
        let terrain = Terrain::open_in(&self.dem, self.height_unit)?;
        Scenario::on(&terrain, self, control)
    }
}

impl Scenario {
    /// Puts the places of the question on a terrain, reads the files it names, and fits the surface.
    ///
    /// # Errors
    /// [`Error::Place`] if a start or goal lies outside the terrain, on a void or on a barrier; a file that cannot be read or
    /// used; those of [`HeightSurface::fit`]; cancelled.
    pub fn on(terrain: &Terrain, question: Question, control: &Control) -> Result<Self> {
        let georeference = terrain.georeference();
        let mut notes = Vec::new();
        let barrier = read_barriers(&question, terrain, &mut notes)?;
        let (start_shapes, starts) = locate(Role::Start, &question.starts, terrain)?;
        let (goal_shapes, goals) = locate(Role::Goal, &question.goals, terrain)?;
        for (goal, shapes) in question.goals.iter().zip(&goal_shapes) {
            check_points(goal, shapes)?;
        }
        let ground = OpenGround { terrain, barrier: barrier.as_deref() };
        starts.iter().chain(&goals).try_for_each(|site| ground.check(site))?;
        for (start, shapes) in question.starts.iter().zip(&start_shapes) {
            ground.check_touched(start, shapes)?;
        }
        let (tensors, cost) = (question.tensors.as_deref(), question.cost.as_deref());
        let tensors = tensors.map(|path| read_tensors(path, georeference)).transpose()?;
        let cost = cost.map(|path| read_costs(path, georeference)).transpose()?;
        let surface = HeightSurface::fit(terrain, &question.fit, control)
            .map_err(|error| error.in_file(&question.dem))?;
        Ok(Self {
            georeference: georeference.clone(),
            surface,
            regions: start_shapes.into_iter().map(StartRegion::from).collect(),
            starts,
            goals,
            notes,
            barrier,
            tensors,
            cost,
            question,
        })
    }

    /// The grid.
    #[must_use]
    pub fn frame(&self) -> &GridFrame {
        self.georeference.frame()
    }

    /// The user's speed tensors at the nodes, row-major, x east and y north, if the question names some.
    #[must_use]
    pub fn tensors(&self) -> Option<&Arc<[Sym2]>> {
        self.tensors.as_ref()
    }

    /// The goal of a question that may have one only.
    ///
    /// # Errors
    /// There is none, or more than one.
    pub fn only_goal(&self) -> Result<&Site> {
        match &self.goals[..] {
            [goal] => Ok(goal),
            goals => Err(Error::argument("the number of goals", goals.len(), "1")),
        }
    }

    /// A metric on the surface, with barriers, costs and aversions.
    ///
    /// # Errors
    /// Those of [`Metric::on`]; [`Error::Place`] if a start or goal lies on a node that is closed under the metric; cancelled.
    pub fn bind(&self, metric: &dyn Metric, control: &Control) -> Result<MetricField<'_>> {
        let modifiers = Modifiers {
            climb_weight: self.question.climb_weight,
            max_slope_deg: self.question.max_slope_deg,
            barrier: self.barrier.clone(),
            cost: self.cost.clone(),
        };
        let field = metric.on(&self.surface, &modifiers, control)?;
        let is_open = |col, row| field.is_open(col, row);
        for site in self.starts.iter().chain(&self.goals) {
            let (col, row) = site.cell();
            if !is_open(col, row) {
                let kind = PlaceErrorKind::Closed(self.obstacles_at(col, row));
                return Err(site.refusal(&self.georeference, kind, is_open));
            }
        }
        Ok(field)
    }

    /// What closes a node to a metric, but voids and barriers.
    fn obstacles_at(&self, col: usize, row: usize) -> Vec<Obstacle> {
        let node = self.frame().index(col, row);
        let slope = || self.surface.jet(DVec2::new(col as f64, row as f64)).slope().to_degrees();
        let has_tensor = self.tensors.as_ref().is_none_or(|tensors| tensors[node].xx.is_finite());
        let has_cost = self.cost.as_ref().is_none_or(|cost| cost[node].is_finite());
        let is_steep = self.question.max_slope_deg.is_some_and(|most| slope() > most);
        let no_value = (!has_tensor || !has_cost).then_some(Obstacle::NoValue);
        no_value.into_iter().chain(is_steep.then_some(Obstacle::Slope)).collect()
    }

    /// What level ground costs on the metric ([`MetricField::level`]), if the climb weight is more than 1000 times as much: the grid then cannot
    /// follow the metric, and distances come out far too short. Else `None`.
    #[must_use]
    pub fn level_cost_dominated_by_climb(&self, field: &MetricField<'_>) -> Option<f64> {
        /// A grade of 60 % is then 19 times as costly as level ground. Across Andorra (75 m cells) the distance is 9 % too short at 1800,
        /// 36 % at 6000.
        const LARGEST: f64 = 1000.0;
        field.level().filter(|level| self.question.climb_weight > LARGEST * level)
    }

    /// Distance from the nearest start in the unit of `field`, at all goals at least.
    ///
    /// # Errors
    /// [`Error::NoPath`] if a goal cannot be reached, with the nearest place that can; those of
    /// [`Solver::solve`](crate::Solver::solve).
    pub fn solve(
        &self,
        field: &MetricField<'_>,
        stop: &Stop,
        control: &Control,
    ) -> Result<DistanceMap> {
        let distance = self.question.solver.solve(field, &self.regions, stop, control)?;
        let unreached = self.goals.iter().find(|goal| distance.at(goal.at).is_none());
        distance.check()?;
        match unreached {
            None => Ok(distance),
            Some(goal) => {
                let is_reached = |col, row| distance.at_node(col, row).is_finite();
                Err(Error::NoPath {
                    goal: Location::Grid(goal.at),
                    between: field.obstacles(),
                    nearest: nearest(self.frame(), goal.at, is_reached).map(Location::Grid),
                })
            }
        }
    }

    /// The route from the nearest start to each goal.
    ///
    /// # Errors
    /// As [`solve`](Self::solve); cancelled.
    pub fn routes(&self, field: &MetricField<'_>, control: &Control) -> Result<Vec<Route>> {
        let stop = Stop::AllGoals(self.goals.iter().map(|goal| goal.at).collect());
        self.routes_on(&self.solve(field, &stop, control)?, field, control)
    }

    /// The route to each goal on a distance that is solved already.
    ///
    /// # Errors
    /// [`Error::NoPath`] if a goal was not reached; cancelled.
    pub fn routes_on(
        &self,
        distance: &DistanceMap,
        field: &MetricField<'_>,
        control: &Control,
    ) -> Result<Vec<Route>> {
        let to_goal = |goal: &Site| {
            control.check()?;
            trace(distance, field, goal.at)
        };
        self.goals.par_iter().map(to_goal).collect()
    }

    /// The route to the only goal under each of several metrics, measured under all of them.
    ///
    /// # Errors
    /// As [`solve`](Self::solve) and [`only_goal`](Self::only_goal).
    pub fn compare(&self, fields: &[MetricField<'_>], control: &Control) -> Result<Comparison> {
        let (goal, solver) = (self.only_goal()?.at, self.question.solver);
        Comparison::between(solver, fields, &self.regions, goal, control)
            .or_else(|error| self.explain(error, fields, control))
    }

    /// Of an error for want of a path, the one that says on which metric and where the distance ends before the goal; else the error itself.
    fn explain<T>(&self, error: Error, fields: &[MetricField<'_>], control: &Control) -> Result<T> {
        if let Error::NoPath { .. } = error {
            for field in fields {
                self.solve(field, &Stop::Never, control)?;
            }
        }
        Err(error)
    }

    /// Whether each node, row-major, has a height but is closed in `field`.
    #[must_use]
    pub fn closed_nodes(&self, field: &MetricField<'_>) -> Vec<bool> {
        let frame = self.frame();
        let nodes = (0..frame.rows()).flat_map(|row| (0..frame.cols()).map(move |col| (col, row)));
        nodes.map(|(c, r)| !field.is_open(c, r) && !self.surface.is_void(c, r)).collect()
    }
}

/// The cells that the barriers touch, row-major; `None` without barriers. A file that is not what a barrier should be gets a note.
fn read_barriers(
    question: &Question,
    terrain: &Terrain,
    notes: &mut Vec<String>,
) -> Result<Option<Arc<[bool]>>> {
    let mut cells: Option<Vec<bool>> = None;
    for path in &question.barriers {
        let shapes = read_geojson(path, terrain.georeference())?;
        let touched = rasterise(terrain.frame(), &shapes);
        if let Some(note) = note_of_barrier(&shapes, &touched, terrain) {
            notes.push(format!("{}: the barrier {note}", path.display()));
        }
        match &mut cells {
            Some(cells) => cells.iter_mut().zip(touched).for_each(|(cell, more)| *cell |= more),
            None => cells = Some(touched),
        }
    }
    Ok(cells.map(Arc::from))
}

/// What the user should know of a barrier that touches these cells.
fn note_of_barrier(shapes: &Shapes, touched: &[bool], terrain: &Terrain) -> Option<&'static str> {
    let heights = terrain.heights();
    let mut stopped = (0..heights.len()).filter(|&node| touched[node]).peekable();
    if stopped.peek().is_none() {
        Some("lies outside the DEM and stops nothing")
    } else if stopped.all(|node| heights[node].is_nan()) {
        Some("lies on voids, which nobody enters anyway, and stops nothing")
    } else if shapes.polygons.iter().any(|polygon| is_flat(polygon, touched, terrain.frame())) {
        Some("has an area without an inside: it stops where its border runs only")
    } else {
        None
    }
}

/// Whether the outer border of a polygon surrounds nothing: no area, and none of the nodes that it touches, as that of a bow tie does.
fn is_flat(polygon: &Polygon<f64>, touched: &[bool], frame: &GridFrame) -> bool {
    /// Square cells, far less than matters and more than rounding leaves.
    const SMALLEST: f64 = 1e-6;
    let double: f64 = polygon.exterior().lines().map(|side| side.determinant()).sum();
    let area = Shapes::from(polygon.clone());
    let node = |i: usize| DVec2::new((i % frame.cols()) as f64, (i / frame.cols()) as f64);
    double.abs() < SMALLEST && !(0..touched.len()).any(|i| touched[i] && area.contains(node(i)))
}

/// Cells that are neither void nor barrier.
struct OpenGround<'a> {
    terrain: &'a Terrain,
    barrier: Option<&'a [bool]>,
}

impl OpenGround<'_> {
    fn is_open(&self, col: usize, row: usize) -> bool {
        let index = self.terrain.frame().index(col, row);
        !self.terrain.is_void(col, row) && !self.barrier.is_some_and(|cells| cells[index])
    }

    /// # Errors
    /// The site lies on a void or a barrier.
    fn check(&self, site: &Site) -> Result<()> {
        let (col, row) = site.cell();
        if self.is_open(col, row) {
            return Ok(());
        }
        let is_void = self.terrain.is_void(col, row);
        let kind = if is_void { PlaceErrorKind::Void } else { PlaceErrorKind::Barrier };
        Err(site.refusal(self.terrain.georeference(), kind, |c, r| self.is_open(c, r)))
    }

    /// # Errors
    /// The lines and areas of a start without points touch no open cell.
    fn check_touched(&self, start: &Place, shapes: &Shapes) -> Result<()> {
        if !shapes.points.is_empty() {
            return Ok(());
        }
        let frame = self.terrain.frame();
        let touched = rasterise(frame, shapes);
        let mut nodes = (0..frame.nodes()).map(|node| (node % frame.cols(), node / frame.cols()));
        if nodes.any(|(col, row)| touched[frame.index(col, row)] && self.is_open(col, row)) {
            return Ok(());
        }
        Err(bad_file(Role::Start, start, PlaceErrorKind::OffGround))
    }
}

/// # Errors
/// A goal holds lines or areas.
fn check_points(goal: &Place, shapes: &Shapes) -> Result<()> {
    if shapes.lines.is_empty() && shapes.polygons.is_empty() {
        return Ok(());
    }
    Err(bad_file(Role::Goal, goal, PlaceErrorKind::NotPoints))
}

fn bad_file(role: Role, place: &Place, kind: PlaceErrorKind) -> Error {
    Error::Place(Box::new(PlaceError { role, name: place.to_string(), kind, nearest: None }))
}

#[cfg(test)]
mod tests {
    use glam::DVec2;

    use super::*;
    use crate::grid::Ground;
    use crate::metric::Isotropic;
    use crate::terrain::Crs;

    /// Level ground of 9 × 5 cells of 10 m with a column of voids in the middle, but for the last row if there is a gap.
    fn split(gap: bool) -> Terrain {
        let frame = GridFrame::new(9, 5, DVec2::ZERO, DVec2::splat(10.0), Ground::METRES).unwrap();
        let is_void = |node: usize| node % 9 == 4 && !(gap && node / 9 == 4);
        let heights = (0..45).map(|node| if is_void(node) { f64::NAN } else { 100.0 }).collect();
        Terrain::new(frame, heights, Crs::none()).unwrap()
    }

    fn scenario(terrain: &Terrain, start: &str, goal: &str) -> Result<Scenario> {
        let question = Question::new("split.tif").from(start.parse()?).to(goal.parse()?);
        Scenario::on(terrain, question, &Control::default())
    }

    #[test]
    fn bad_places_are_reported_as_data() {
        let refused = |start: &str, goal: &str| match scenario(&split(true), start, goal) {
            Err(Error::Place(place)) => *place,
            other => panic!("{other:?}"),
        };
        let void = refused("pixel:4,1", "pixel:0,0");
        assert_eq!((void.role, void.kind), (Role::Start, PlaceErrorKind::Void));
        assert_eq!((void.name.as_str(), void.nearest.as_deref()), ("pixel:4,1", Some("pixel:3,1")));
        let outside = refused("0,0", "70,-90");
        assert_eq!(outside.role, Role::Goal);
        let PlaceErrorKind::Outside { from, to, swapped } = outside.kind else { panic!() };
        assert_eq!((from.as_str(), to.as_str(), swapped), ("0,-40", "80,0", None));
        assert_eq!(outside.nearest.as_deref(), Some("70,-40"));
    }

    #[test]
    fn routes_lead_through_the_gap_or_nowhere() {
        let control = Control::default();
        for gap in [true, false] {
            let scenario = scenario(&split(gap), "pixel:1,1", "pixel:7,1").unwrap();
            let field = scenario.bind(&Isotropic, &control).unwrap();
            match scenario.routes(&field, &control) {
                Ok(routes) => {
                    assert!(gap && routes.len() == 1);
                    assert!(routes[0].summary.length_m > 60.0);
                }
                Err(Error::NoPath { goal, between, nearest }) => {
                    assert!(!gap);
                    assert_eq!(goal, Location::Grid(DVec2::new(7.0, 1.0)));
                    assert_eq!(between, [Obstacle::Void]);
                    assert_eq!(nearest, Some(Location::Grid(DVec2::new(3.0, 1.0))));
                }
                Err(error) => panic!("{error}"),
            }
        }
    }

    #[test]
    fn the_record_names_what_was_asked() {
        let scenario = scenario(&split(true), "pixel:1,1", "10,-20").unwrap();
        let field = scenario.bind(&Isotropic, &Control::default()).unwrap();
        let record = scenario.provenance(&[field], Some("ridgeway route".into()));
        let json = serde_json::to_value(record).unwrap();
        assert_eq!(json["start"][0], "pixel:1,1");
        assert_eq!(json["goal"][0], "10,-20");
        assert_eq!(json["dem"], "split.tif");
        assert_eq!(json["accuracy"], "fast");
        assert_eq!(json["metrics"][0]["name"], "isotropic");
        assert!(json["metrics"][0]["delta_per_m"].is_null());
    }

    #[test]
    fn a_barrier_that_stops_nothing_gets_a_note() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("wall.geojson");
        let crs = Crs::from_epsg(32632).unwrap();
        let frame =
            GridFrame::new(9, 5, DVec2::new(5e5, 5e6), DVec2::splat(10.0), crs.ground()).unwrap();
        let mut heights = vec![100.0; 45];
        heights[22] = f64::NAN;
        let terrain = Terrain::new(frame, heights, crs).unwrap();
        let question = Question {
            barriers: vec![path.clone()],
            ..Question::new("level.tif").from(Place::pixel(1.0, 1.0))
        };
        let notes = |kind: &str, cells: &[[f64; 2]]| {
            let lonlat = |&cell: &[f64; 2]| terrain.to_lonlat(cell.into()).unwrap().to_array();
            let line: Vec<_> = cells.iter().map(lonlat).collect();
            let coordinates =
                if kind == "Polygon" { format!("[{line:?}]") } else { format!("{line:?}") };
            let text = format!(r#"{{"type":"{kind}","coordinates":{coordinates}}}"#);
            std::fs::write(&path, text).unwrap();
            Scenario::on(&terrain, question.clone(), &Control::default()).unwrap().notes
        };
        assert_eq!(notes("LineString", &[[3.0, 1.0], [3.0, 4.0]]), [""; 0]);
        let outside = notes("LineString", &[[300.0, 1.0], [300.0, 4.0]]);
        assert!(outside[0].contains("lies outside the DEM"), "{outside:?}");
        let on_void = notes("MultiPoint", &[[4.0, 2.0]]);
        assert!(on_void[0].contains("lies on voids"), "{on_void:?}");
        let flat = notes("Polygon", &[[3.0, 1.0], [5.0, 3.0], [4.0, 2.0], [3.0, 1.0]]);
        assert!(flat[0].contains("without an inside"), "{flat:?}");
        let bow_tie = [[2.0, 0.2], [6.0, 3.8], [6.0, 0.2], [2.0, 3.8], [2.0, 0.2]];
        assert_eq!(notes("Polygon", &bow_tie), [""; 0]);
    }
}
