//! Colours.

/// An opaque colour: red, green, blue, each 0 to 255 (sRGB).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Rgb(pub u8, pub u8, pub u8);

impl Rgb {
    /// Blue, for the isotropic metric. With [`ORANGE`](Self::ORANGE) it can be distinguished with any
    /// kind of colour vision.
    pub const BLUE: Self = Self(0x1a, 0x6f, 0xdf);
    /// Red-orange, for the curvature metric.
    pub const ORANGE: Self = Self(0xd7, 0x30, 0x1f);
    /// Magenta, for the difference metric.
    pub const MAGENTA: Self = Self(0xb0, 0x2a, 0x8f);
    /// Green, for starts (with the letter S).
    pub const GREEN: Self = Self(0x1b, 0x78, 0x37);
    /// Purple, for goals (with the letter G).
    pub const PURPLE: Self = Self(0x76, 0x2a, 0x83);
    /// Near black, for text.
    pub const INK: Self = Self(0x22, 0x22, 0x22);
    /// White.
    pub const WHITE: Self = Self(0xff, 0xff, 0xff);

    /// This colour at `share` 0, `other` at 1.
    pub(super) fn mix(self, other: Self, share: f64) -> Self {
        let share = share.clamp(0.0, 1.0);
        let mix =
            |a: u8, b: u8| (f64::from(a) + share * (f64::from(b) - f64::from(a))).round() as u8;
        Self(mix(self.0, other.0), mix(self.1, other.1), mix(self.2, other.2))
    }
}
