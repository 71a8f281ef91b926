//! A route in one call.

use std::path::Path;

use super::place::Place;
use super::question::Question;
use crate::control::Control;
use crate::error::Result;
use crate::metric::Curvature;
use crate::route::Route;

/// The route from `start` to `goal` over a DEM on the curvature metric, with the defaults of everything.
///
/// # Errors
/// Those of [`Question::prepare`], [`Scenario::bind`](super::Scenario::bind) and [`Scenario::routes`](super::Scenario::routes); a goal that is not one point.
pub fn route(dem: impl AsRef<Path>, start: Place, goal: Place) -> Result<Route> {
    let control = Control::default();
    let scenario = Question::new(dem.as_ref()).from(start).to(goal).prepare(&control)?;
    scenario.only_goal()?;
    let metric = scenario.bind(&Curvature::default(), &control)?;
    Ok(scenario.routes(&metric, &control)?.swap_remove(0))
}
