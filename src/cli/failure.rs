//! Why a command fails, in the words of the command, and its exit code.

use std::io::ErrorKind;

use ridgeway::Error;
use ridgeway::error::{Location, Obstacle, PlaceError, PlaceErrorKind, Remedy};
use ridgeway::plan::Scenario;

/// `Result` of a command.
pub(crate) type Result<T, E = Failure> = std::result::Result<T, E>;

/// A sentence for people and an exit code for scripts.
#[derive(Debug)]
pub(crate) struct Failure {
    pub(crate) message: String,
    pub(crate) code: u8,
}

const NO_PATH: u8 = 1;
const WRONG_USE: u8 = 2;
const READING_OR_WRITING: u8 = 3;
const CANCELLED: u8 = 130;

impl Failure {
    /// The command was used wrongly.
    pub(crate) fn usage(message: impl Into<String>) -> Self {
        Self { message: message.into(), code: WRONG_USE }
    }

    /// Turns errors into failures that name the goal that cannot be reached as the user wrote it.
    pub(crate) fn naming_goals(scenario: &Scenario) -> impl Fn(Error) -> Self {
        |error| Self::naming_goal(error, scenario)
    }

    fn naming_goal(error: Error, scenario: &Scenario) -> Self {
        let Error::NoPath { goal: Location::Grid(at), between, nearest } = &error else {
            return error.into();
        };
        let Some(goal) = scenario.goals.iter().find(|goal| goal.at == *at) else {
            return error.into();
        };
        let mut message = format!("--goal {} cannot be reached from the start", goal.name);
        if !between.is_empty() {
            message += &format!(": {} lie between", Obstacle::any_of(between));
        }
        if let Some(Location::Grid(near)) = *nearest
            && let Ok(near) = goal.notation.write(near, &scenario.georeference)
        {
            message += &format!("; the nearest place that can be reached is {near}");
        }
        Self { message, code: NO_PATH }
    }
}

/// What to do where memory is short.
const SMALLER: &str = "; take a part of the DEM with `gdalwarp -te`, larger cells with `gdalwarp -tr`, or end other programs";

impl From<Error> for Failure {
    /// What the library says, and what to do about it here.
    fn from(error: Error) -> Self {
        let (code, advice) = match &error {
            Error::NoPath { .. } => (NO_PATH, ""),
            Error::Cancelled => (CANCELLED, "; nothing was written"),
            // A file that exists is a wrong use, not a fault of the disk.
            Error::Io { source, .. } if source.kind() == ErrorKind::AlreadyExists => {
                (WRONG_USE, "; give --overwrite to replace it")
            }
            Error::Io { source, .. } => (READING_OR_WRITING, advice(source.kind())),
            Error::TooLarge { .. } => (WRONG_USE, SMALLER),
            Error::Place(place) => return Self::usage(refusal(place)),
            _ => (WRONG_USE, error.remedy().map_or("", tool)),
        };
        Self { message: format!("{error}{advice}"), code }
    }
}

/// The tool for a remedy: how the sentence of the error goes on.
fn tool(remedy: Remedy) -> &'static str {
    match remedy {
        Remedy::Convert => " with `gdal_translate IN OUT.tif`",
        Remedy::ConvertSamples => " with `gdal_translate -ot Float32 IN OUT.tif`",
        Remedy::Recompress => " with `gdal_translate -co COMPRESS=DEFLATE IN OUT.tif`",
        Remedy::TakeBand => " with `gdal_translate -b N IN OUT.tif`",
        Remedy::TurnNorthUp => " with `gdalwarp -r bilinear IN OUT.tif`",
        Remedy::Rectify => " with `gdalwarp -tps IN OUT.tif`",
        Remedy::Reproject => " with `gdalwarp -t_srs EPSG:... IN OUT.tif`",
        Remedy::ReprojectToLonLat => " with `gdalwarp -t_srs EPSG:4326 IN OUT.tif`",
        Remedy::SetCrs => " with `gdal_edit.py -a_srs EPSG:... FILE.tif`",
        Remedy::ReplaceWkt => ", which `gdalsrsinfo -o wkt1 EPSG:...` prints",
        Remedy::ScaleToMetres => ", for example with `gdal_calc.py`",
        Remedy::ResampleToDem => ", for example with `gdalwarp -te -ts`",
        Remedy::ReprojectToDem => ", for example with `gdalwarp -t_srs -te -ts`",
        Remedy::ConvertToGeoJson => ", with `ogr2ogr -t_srs EPSG:4326 OUT.geojson IN`",
        Remedy::Unpack => ", for example with `gunzip` or `unzip`",
        Remedy::FetchFromLfs => " with `git lfs pull`",
        _ => "",
    }
}

fn advice(kind: ErrorKind) -> &'static str {
    match kind {
        ErrorKind::NotFound => "; check its name and the folder you are in",
        ErrorKind::IsADirectory => "; name a file",
        ErrorKind::PermissionDenied => "; check who may read and write it",
        _ => "",
    }
}

/// Why the place that was given to a flag cannot be used.
fn refusal(place: &PlaceError) -> String {
    let PlaceError { role, name, kind, nearest } = place;
    match kind {
        PlaceErrorKind::NotPoints => {
            format!("--{role} takes points; its file also holds lines or areas")
        }
        PlaceErrorKind::OffGround => format!(
            "--{role}: its lines and areas touch no open cell of the DEM; the file must be in longitude and \
             latitude (RFC 7946) and overlap the DEM"
        ),
        PlaceErrorKind::Closed(by) if !by.is_empty() => {
            let reasons: Vec<_> = by.iter().map(flag_that_closes).collect();
            let advice = match nearest {
                Some(near) => format!("; the nearest usable place is {near}"),
                None => ", and so does every other cell".to_owned(),
            };
            format!("--{role} {name} lies {}{advice}", reasons.join(" and "))
        }
        _ => format!("--{role} {name} {}", place.reason()),
    }
}

fn flag_that_closes(obstacle: &Obstacle) -> String {
    match obstacle {
        Obstacle::Slope => "on ground steeper than --max-slope allows".into(),
        Obstacle::NoValue => "where --cost or --tensor has no value".into(),
        other => format!("on {other}"),
    }
}
