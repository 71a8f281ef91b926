//! The kinds of terrain there are.

use std::fmt;
use std::str::FromStr;

use super::shape::Shape;
use super::{cone, craters, fractal, hills, plane, range, round, switchbacks};
use crate::error::{Error, Result};

/// Makes the enumeration of the kinds, each with the [`Shape`] that its file holds.
macro_rules! kinds {
    ($($(#[$doc:meta])* $kind:ident = $file:ident::$shape:ident,)*) => {
        /// The kinds of synthetic terrain. `h` is the relief, `a` half the longer side, both in metres.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        pub enum SyntheticKind {
            $($(#[$doc])* $kind,)*
        }

        impl SyntheticKind {
            /// All kinds, simple ones first.
            pub const ALL: [Self; [$(stringify!($kind)),*].len()] = [$(Self::$kind),*];

            pub(super) fn shape(self) -> &'static Shape {
                match self {
                    $(Self::$kind => &$file::$shape,)*
                }
            }
        }
    };
}

kinds! {
    /// `z = h (0.6 x + 0.8 y) / 2a`: a slope of `h / 2a` that climbs towards N 37° E.
    Plane = plane::PLANE,
    /// A trough along `y` with the cross-section of a circle of radius `R`, `h` deep at `|x| = a`:
    /// `z = R − √(R² − x²)`, `R = (a² + h²) / 2h`.
    ///
    /// A cylinder while `|x| ≤ 0.9 R`, and beyond that its tangent plane.
    Cylinder = round::CYLINDER,
    /// A dome, part of a sphere of radius `R`, `h` high over its rim at `√(x² + y²) = a`:
    /// `z = h − R + √(R² − x² − y²)`, `R = (a² + h²) / 2h`.
    ///
    /// A sphere within `0.9 R` of the centre, and beyond that its tangent cone.
    Sphere = round::SPHERE,
    /// `z = h (1 − √(x² + y²) / a)`: sharp at the tip, where the jet's derivatives are not numbers.
    Cone = cone::CONE,
    /// Five round hills of different height and width, not touching the border.
    Bumps = hills::BUMPS,
    /// Four equal hills with broad tops that meet, as in figure 6 of Seong, Jeong, Cohen (SMI 2008):
    /// `z = h Σ exp(−(r_i / 0.64 a)⁴)` with the distances `r_i` from `(±2a/3, ±2a/3)`.
    FourBumps = hills::FOUR_BUMPS,
    /// Long parallel ridges with valleys between, passes, and spurs down the flanks.
    Range = range::RANGE,
    /// Mountains at every scale: ridged multifractal noise.
    Fractal = fractal::FRACTAL,
    /// A plain under craters of many sizes.
    Craters = craters::CRATERS,
    /// A mountainside rising northwards with a mean grade of `h / 2a`, carved by a zigzag of five
    /// benches that climbs it gently.
    Switchbacks = switchbacks::SWITCHBACKS,
}

impl SyntheticKind {
    /// Name on the command line.
    #[must_use]
    pub fn name(self) -> &'static str {
        self.shape().name
    }

    /// What it is, in a line for people.
    #[must_use]
    pub fn description(self) -> &'static str {
        self.shape().description
    }
}

impl fmt::Display for SyntheticKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl FromStr for SyntheticKind {
    type Err = Error;

    fn from_str(name: &str) -> Result<Self> {
        Self::ALL.into_iter().find(|kind| kind.name() == name).ok_or_else(|| {
            let names = Self::ALL.map(Self::name).join(", ");
            Error::argument("the kind of terrain", format!("`{name}`"), format!("one of {names}"))
        })
    }
}
