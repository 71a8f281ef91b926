//! Flags that all planning commands share: the surface and the metric on it.

use std::path::PathBuf;
use std::sync::Arc;

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use clap::{Args, ValueEnum};
use ridgeway::metric::{MetricOptions, NAMED, NamedMetric};
use ridgeway::terrain::HeightUnit;
use ridgeway::{Accuracy, Degree, Delta, FitOptions, Metric, Smoothing, Solver, Sym2};

use super::values::{OrAuto, delta, difference_delta, not_negative, positive, slope, smoothing};
use crate::failure::{Failure, Result};

/// The surface and the metric on it.
#[derive(Debug, Args)]
pub(crate) struct GroundArgs {
    #[command(flatten)]
    pub(crate) fit: FitArgs,
    #[command(flatten)]
    pub(crate) metric_options: MetricArgs,
}

/// What surface to fit.
#[derive(Debug, Args)]
#[command(next_help_heading = "Surface")]
pub(crate) struct FitArgs {
    /// Unit of the stored heights, where the file does not say it or is wrong.
    #[arg(long, value_enum, value_name = "UNIT")]
    pub(crate) height_unit: Option<HeightUnitName>,
    /// Degree of the B-spline.
    #[arg(long, value_enum, default_value_t = DegreeName::Cubic)]
    pub(crate) degree: DegreeName,
    #[arg(
        long,
        value_name = "METRES",
        value_parser = smoothing,
        allow_hyphen_values = true,
        help = format!(
            "Cut-off wavelength: metres, a number of cells such as 16cells, auto (cross-validation), \
             or 0 to go through every height [default: {}cells]",
            FitOptions::DEFAULT_CUTOFF_CELLS
        )
    )]
    pub(crate) smooth: Option<Smoothing>,
    /// As few knots as keep the root-mean-square residual under this many metres.
    #[arg(long, value_name = "M", conflicts_with = "smooth", value_parser = positive, allow_hyphen_values = true)]
    pub(crate) tolerance: Option<f64>,
}

impl FitArgs {
    pub(crate) fn height_unit(&self) -> Option<HeightUnit> {
        self.height_unit.map(|name| match name {
            HeightUnitName::M => HeightUnit::Metre,
            HeightUnitName::Ft => HeightUnit::Foot,
            HeightUnitName::UsFt => HeightUnit::UsSurveyFoot,
        })
    }

    pub(crate) fn options(&self) -> FitOptions {
        let smoothing = match (self.tolerance, self.smooth) {
            (Some(tolerance), _) => Smoothing::Tolerance(tolerance),
            (None, Some(smoothing)) => smoothing,
            (None, None) => FitOptions::default().smoothing,
        };
        let degree = match self.degree {
            DegreeName::Cubic => Degree::Cubic,
            DegreeName::Quintic => Degree::Quintic,
        };
        FitOptions { degree, smoothing }
    }
}

#[derive(Clone, Copy, Debug, ValueEnum)]
pub(crate) enum HeightUnitName {
    /// Metres.
    M,
    /// International feet.
    Ft,
    /// US survey feet.
    UsFt,
}

/// The one metric of a command.
#[derive(Debug, Args)]
pub(crate) struct MetricChoice {
    /// The metric [default: curvature, or tensor with --tensor].
    #[arg(long, value_parser = metric(), value_name = "METRIC")]
    pub(crate) metric: Option<NamedMetric>,
}

/// What a metric needs to know, and what composes with all of them.
#[derive(Debug, Args)]
#[command(next_help_heading = "Metric")]
pub(crate) struct MetricArgs {
    /// How much straight, uncurved ground costs in comparison with curved: `auto` (a tenth of the
    /// root-mean-square curvature; all of it in the curvature tensors that the difference metrics compare), `auto:SHARE`, or a
    /// curvature in 1/m.
    #[arg(long, value_name = "1/M", default_value = "auto", value_parser = delta, allow_hyphen_values = true)]
    pub(crate) delta: OrAuto<Delta>,
    /// How much ground of even shape costs in comparison with ground where the curvature changes, on the difference metrics: `auto` (the
    /// square of the mean rate of change), `auto:SHARE` of it, or a number in their own unit (none; m² if literal).
    #[arg(long, value_name = "VALUE", default_value = "auto", value_parser = difference_delta, allow_hyphen_values = true)]
    pub(crate) difference_delta: OrAuto<Delta>,
    /// Aversion to grade: β of the term β∇z∇zᵀ added to the metric.
    ///
    /// On the isotropic metric going up or down a grade s costs √(1 + s² + βs²) per plan metre: with
    /// 100 a grade of 10 % costs 1.4 times as much as level ground. On the curvature metric level,
    /// straight ground costs √δ, so the same aversion takes 100 δ. With more than 1000, or 1000 δ,
    /// distances come out far too short.
    #[arg(long, value_name = "BETA", default_value = "0", value_parser = not_negative, allow_hyphen_values = true)]
    pub(crate) climb_weight: f64,
    /// Ground steeper than this many degrees may not be entered.
    #[arg(long, value_name = "DEG", value_parser = slope, allow_hyphen_values = true)]
    pub(crate) max_slope: Option<f64>,
    /// Lines and areas (GeoJSON) that may not be crossed; may be given several times.
    #[arg(long, value_name = "FILE.geojson")]
    pub(crate) barrier: Vec<PathBuf>,
    /// What the ground costs: a raster on the DEM's grid with a factor above 0 on the length of every step,
    /// the largest at most 1000 times the smallest; cells without a value may not be entered.
    #[arg(long, value_name = "FILE.tif")]
    pub(crate) cost: Option<PathBuf>,
    /// Your own speed tensors: a float raster on the DEM's grid with bands D11, D12, D22, x east, y north.
    #[arg(long, value_name = "FILE.tif")]
    pub(crate) tensor: Option<PathBuf>,
    /// How exactly to solve: `high` is of second order in the cell size and takes 2.1 to 3.7 times as long in the solver.
    #[arg(long, value_enum, value_name = "HOW", default_value_t = AccuracyName::Fast)]
    pub(crate) accuracy: AccuracyName,
}

impl MetricArgs {
    pub(crate) fn solver(&self) -> Solver {
        let accuracy = match self.accuracy {
            AccuracyName::Fast => Accuracy::Fast,
            AccuracyName::High => Accuracy::High,
        };
        Solver { accuracy, ..Solver::default() }
    }

    /// The metric to use where the user asks for `asked`.
    ///
    /// # Errors
    /// As [`check_tensor`](Self::check_tensor).
    pub(crate) fn chosen(&self, asked: Option<NamedMetric>) -> Result<NamedMetric> {
        let metric = asked.unwrap_or(self.default_metric());
        self.check_tensor(&[metric])?;
        Ok(metric)
    }

    /// The metric that a user who names none wants.
    pub(crate) fn default_metric(&self) -> NamedMetric {
        metric_named(if self.tensor.is_some() { TENSOR } else { CURVATURE })
    }

    /// # Errors
    /// `--tensor` with metrics that do not look at it.
    pub(crate) fn check_tensor(&self, metrics: &[NamedMetric]) -> Result<()> {
        if self.tensor.is_some() && !metrics.iter().any(|metric| metric.name == TENSOR) {
            return Err(Failure::usage(
                "--tensor is used by the metric `tensor` alone, which is not asked for; name it, or leave --tensor out",
            ));
        }
        Ok(())
    }

    /// The metric of this name, with the user's tensors if there are any.
    ///
    /// # Errors
    /// `tensor` without tensors.
    pub(crate) fn metric(
        &self,
        metric: NamedMetric,
        tensors: Option<&Arc<[Sym2]>>,
    ) -> Result<Box<dyn Metric>> {
        if metric.name == TENSOR && tensors.is_none() {
            return Err(Failure::usage("the metric `tensor` needs --tensor FILE.tif"));
        }
        Ok(metric.with(&MetricOptions {
            delta: self.delta,
            difference_delta: self.difference_delta,
            tensors: tensors.cloned(),
        })?)
    }

    /// The first flag given that only a DEM can have.
    pub(crate) fn dem_only_flag(&self) -> Option<&'static str> {
        let given = [
            ("--climb-weight", self.climb_weight > 0.0),
            ("--max-slope", self.max_slope.is_some()),
            ("--barrier", !self.barrier.is_empty()),
            ("--cost", self.cost.is_some()),
            ("--tensor", self.tensor.is_some()),
        ];
        given.into_iter().find_map(|(flag, given)| given.then_some(flag))
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum AccuracyName {
    /// First order.
    Fast,
    /// Second order, with an estimate of the error.
    High,
}

/// The metric of `--tensor`.
pub(crate) const TENSOR: &str = "tensor";
/// The metric of a user who names none.
pub(crate) const CURVATURE: &str = "curvature";

/// The metric of a name that is one of [`NAMED`].
pub(crate) fn metric_named(name: &str) -> NamedMetric {
    NamedMetric::find(name).expect("the library has it")
}

/// Takes the name of a metric.
pub(super) fn metric() -> impl TypedValueParser<Value = NamedMetric> {
    let names = NAMED.map(|metric| PossibleValue::new(metric.name).help(metric.about));
    PossibleValuesParser::new(names).map(|name| metric_named(&name))
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum DegreeName {
    /// Continuous curvature.
    Cubic,
    /// Continuous fourth derivatives.
    Quintic,
}
