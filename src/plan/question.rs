//! What is asked: files, places and options.

use std::path::PathBuf;

use super::place::Place;
use crate::eikonal::Solver;
use crate::surface::FitOptions;
use crate::terrain::HeightUnit;

/// A question as it is asked: nothing is read yet.
#[derive(Clone, Debug, Default)]
pub struct Question {
    /// The DEM.
    pub dem: PathBuf,
    /// The unit of its heights, if that is known better than the file says it.
    pub height_unit: Option<HeightUnit>,
    /// Where paths begin: the nearest start counts.
    pub starts: Vec<Place>,
    /// Where to go.
    pub goals: Vec<Place>,
    /// What surface to fit to the DEM.
    pub fit: FitOptions,
    /// How the distance is solved.
    pub solver: Solver,
    /// Aversion to grade, see [`Modifiers::climb_weight`](crate::Modifiers::climb_weight).
    pub climb_weight: f64,
    /// Ground steeper than this many degrees may not be entered.
    pub max_slope_deg: Option<f64>,
    /// GeoJSON files of points, lines and areas that may not be crossed.
    pub barriers: Vec<PathBuf>,
    /// A raster on the DEM's grid with a factor on the length of every step, see [`Modifiers::cost`](crate::Modifiers::cost).
    pub cost: Option<PathBuf>,
    /// A raster on the DEM's grid with the bands D11, D12, D22 of speed tensors, for a metric of the user's own.
    pub tensors: Option<PathBuf>,
}

impl Question {
    /// A question about a DEM, without places and with the defaults of everything else.
    #[must_use]
    pub fn new(dem: impl Into<PathBuf>) -> Self {
        Self { dem: dem.into(), ..Self::default() }
    }

    /// With one more start.
    #[must_use]
    pub fn from(mut self, start: Place) -> Self {
        self.starts.push(start);
        self
    }

    /// With one more goal.
    #[must_use]
    pub fn to(mut self, goal: Place) -> Self {
        self.goals.push(goal);
        self
    }
}
