//! Why a place cannot be used or reached.

use std::fmt;

/// A start or a goal that cannot be used.
#[derive(Clone, Debug, PartialEq)]
pub struct PlaceError {
    /// What the place is for.
    pub role: Role,
    /// The place as it was given, such as `pixel:3,4`.
    pub name: String,
    /// What is wrong with it.
    pub kind: PlaceErrorKind,
    /// The nearest place that would do, written in the same way; `None` if there is none, or it makes no sense to look for one.
    pub nearest: Option<String>,
}

/// What a place is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// Paths begin there.
    Start,
    /// Paths end there.
    Goal,
}

/// What is wrong with a place.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum PlaceErrorKind {
    /// It lies outside the DEM.
    Outside {
        /// The first corner of the DEM: south-west, or of pixels north-west.
        from: String,
        /// The opposite corner.
        to: String,
        /// What its two numbers are called, and the place with the two swapped, if that lies on the DEM.
        swapped: Option<(&'static str, String)>,
    },
    /// It lies on a void.
    Void,
    /// It lies on a barrier.
    Barrier,
    /// It is closed under the metric because of these; if none, because the metric is too extreme there.
    Closed(Vec<Obstacle>),
    /// It is a file with lines or areas where points are needed.
    NotPoints,
    /// It is a file whose lines and areas touch no open cell of the DEM.
    OffGround,
}

/// A kind of place that no path enters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Obstacle {
    /// Cells without a height.
    Void,
    /// Barriers.
    Barrier,
    /// Ground steeper than the limit.
    Slope,
    /// Places at which a raster gives no cost or no tensor.
    NoValue,
}

impl PlaceError {
    /// What is wrong with the place, and where a better one is: the predicate of a sentence about it.
    #[must_use]
    pub fn reason(&self) -> String {
        let Self { kind, nearest, .. } = self;
        let advice = match (kind, nearest) {
            (PlaceErrorKind::NotPoints | PlaceErrorKind::OffGround, _)
            | (PlaceErrorKind::Outside { swapped: Some(_), .. }, _)
            | (PlaceErrorKind::Outside { .. }, None) => String::new(),
            (PlaceErrorKind::Outside { .. }, Some(near)) => {
                format!("; the nearest place on it is {near}")
            }
            (_, Some(near)) => format!("; the nearest usable place is {near}"),
            (_, None) => ", and so does every other cell".to_owned(),
        };
        format!("{kind}{advice}")
    }
}

impl fmt::Display for PlaceError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "the {} {} {}", self.role, self.name, self.reason())
    }
}

impl fmt::Display for Role {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Start => "start",
            Self::Goal => "goal",
        })
    }
}

impl fmt::Display for PlaceErrorKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Outside { from, to, swapped } => {
                write!(f, "lies outside the DEM, which reaches from {from} to {to}")?;
                match swapped {
                    Some((axes, place)) => write!(f, "; {axes} look swapped: try {place}"),
                    None => Ok(()),
                }
            }
            Self::Void => f.write_str("lies on a void of the DEM"),
            Self::Barrier => f.write_str("lies on a barrier"),
            Self::Closed(by) if by.is_empty() => {
                f.write_str("lies where the metric is too extreme to compute with")
            }
            Self::Closed(by) => {
                let by: Vec<_> = by.iter().map(Obstacle::to_string).collect();
                write!(f, "lies on ground that is closed under the metric: {}", by.join(", "))
            }
            Self::NotPoints => f.write_str("holds lines or areas; only points will do"),
            Self::OffGround => f.write_str(
                "touches no open cell of the DEM; the file must be in longitude and latitude (RFC 7946) and overlap the DEM",
            ),
        }
    }
}

impl Obstacle {
    /// Obstacles as the subject of a sentence: `voids, barriers or too steep ground`.
    #[must_use]
    pub fn any_of(obstacles: &[Self]) -> String {
        let names: Vec<_> = obstacles.iter().map(Self::to_string).collect();
        match &names[..] {
            [] => String::new(),
            [one] => one.clone(),
            [first @ .., last] => format!("{} or {last}", first.join(", ")),
        }
    }
}

impl fmt::Display for Obstacle {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Void => "voids",
            Self::Barrier => "barriers",
            Self::Slope => "too steep ground",
            Self::NoValue => "places without a cost or tensor",
        })
    }
}
