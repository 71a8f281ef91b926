//! Units of distances.

use std::fmt;

use serde::{Serialize, Serializer};

/// What the distances of a metric are counted in.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Unit {
    /// Not known: tensors of any origin.
    #[default]
    Unknown,
    /// Metres.
    Metres,
    /// Units of anisotropic geodesic distance; what they are depends on the metric.
    Ag,
    /// Another, by its symbol.
    Named(&'static str),
}

impl Unit {
    /// Its symbol: `m`, `AG units`, …; empty if it is not known.
    #[must_use]
    pub fn symbol(self) -> &'static str {
        match self {
            Self::Unknown => "",
            Self::Metres => "m",
            Self::Ag => "AG units",
            Self::Named(symbol) => symbol,
        }
    }

    /// The unit once steps are weighed by more than their length: metres are no longer metres.
    pub(super) fn weighted(self) -> Self {
        if self == Self::Metres { Self::Ag } else { self }
    }
}

impl fmt::Display for Unit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.symbol())
    }
}

impl Serialize for Unit {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.symbol())
    }
}
