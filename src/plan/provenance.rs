//! The record of how a result was made.

use std::collections::BTreeMap;
use std::path::Path;

use serde::Serialize;

use super::place::Place;
use super::scenario::Scenario;
use super::surface::describe_fit;
use crate::eikonal::Accuracy;
use crate::metric::{MetricField, Unit};

/// The version of this crate that made a result.
pub(super) const SOFTWARE: &str = concat!("ridgeway ", env!("CARGO_PKG_VERSION"));

/// All that is needed to ask a question again. Files are named without their folders.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Provenance {
    /// The metrics.
    pub metrics: Vec<MetricRecord>,
    /// Name and version of this crate.
    pub software: &'static str,
    /// The command line, if there was one.
    pub command: Option<String>,
    /// The DEM.
    pub dem: String,
    /// The surface in words.
    pub surface: String,
    /// Cut-off wavelength of the surface in metres, if it has one.
    pub cutoff_m: Option<f64>,
    /// Aversion to grade `β`, see [`Modifiers::climb_weight`](crate::Modifiers::climb_weight).
    pub climb_weight: f64,
    /// The steepest ground that may be entered, degrees.
    pub max_slope_deg: Option<f64>,
    /// The files of barriers.
    pub barriers: Vec<String>,
    /// The raster of costs.
    pub cost: Option<String>,
    /// The raster of speed tensors.
    pub tensor: Option<String>,
    /// How exactly the distance was solved: `fast` or `high`.
    pub accuracy: &'static str,
    /// The starts as they were given.
    pub start: Vec<String>,
    /// The points of the goals as they were given.
    pub goal: Vec<String>,
}

/// A metric and its parameters.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MetricRecord {
    /// Its name.
    pub name: String,
    /// Unit of its distances.
    pub unit: Unit,
    /// Its parameters by name; `None` for those of other metrics of this crate.
    #[serde(flatten)]
    pub parameters: BTreeMap<&'static str, Option<f64>>,
}

/// Parameters that every record has, if only to say that the metric has none of that name.
const PARAMETERS: [&str; 2] = ["delta_per_m", "difference_delta"];

impl From<&MetricField<'_>> for MetricRecord {
    fn from(field: &MetricField<'_>) -> Self {
        let none = PARAMETERS.map(|name| (name, None));
        let some =
            field.parameters().iter().map(|parameter| (parameter.name, Some(parameter.value)));
        Self {
            name: field.name().to_owned(),
            unit: field.unit(),
            parameters: none.into_iter().chain(some).collect(),
        }
    }
}

impl Scenario {
    /// All that is needed to ask again under `fields`; `command` is the command line, if there was one.
    #[must_use]
    pub fn provenance(&self, fields: &[MetricField<'_>], command: Option<String>) -> Provenance {
        let question = &self.question;
        Provenance {
            metrics: fields.iter().map(MetricRecord::from).collect(),
            software: SOFTWARE,
            command,
            dem: file_name(&question.dem),
            surface: describe_fit(&question.fit, &self.surface),
            cutoff_m: self.surface.cutoff(),
            climb_weight: question.climb_weight,
            max_slope_deg: question.max_slope_deg,
            barriers: question.barriers.iter().map(|path| file_name(path)).collect(),
            cost: question.cost.as_deref().map(file_name),
            tensor: question.tensors.as_deref().map(file_name),
            accuracy: match question.solver.accuracy {
                Accuracy::Fast => "fast",
                Accuracy::High => "high",
            },
            start: question.starts.iter().map(Place::to_string).collect(),
            goal: self.goals.iter().map(|goal| goal.name.clone()).collect(),
        }
    }
}

/// The name of a file without its folder.
pub(super) fn file_name(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}
