//! Values as colours.

use super::colour::Rgb;
use super::relief::VOID;

/// Share of the values that a diverging bar shows within its ends; the rest take the end colours, as
/// a few extreme curvatures would leave no colour for all the others.
const SHOWN: f64 = 0.98;

/// How values become colours; both can be read with any kind of colour vision.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Gradient {
    /// From the least to the greatest value (viridis).
    Sequential,
    /// Around zero, alike on both sides (ColorBrewer's purple and orange).
    Diverging,
}

impl Gradient {
    /// Colours of values, from the least to the greatest of them; grey where there is none.
    #[must_use]
    pub fn colours(self, values: &[f32]) -> Vec<Rgb> {
        let [low, high] = self.range(values).unwrap_or([0.0, 1.0]);
        let colour = |v: f32| self.colour((f64::from(v) - low) / (high - low));
        values.iter().map(|&v| if v.is_finite() { colour(v) } else { VOID[0] }).collect()
    }

    /// Values at the ends of the bar, never equal; `None` if there is no value at all.
    pub(super) fn range(self, values: &[f32]) -> Option<[f64; 2]> {
        let mut known: Vec<f32> = values.iter().copied().filter(|v| v.is_finite()).collect();
        if known.is_empty() {
            return None;
        }
        let [low, high] = match self {
            Self::Sequential => [f32::min, f32::max]
                .map(|pick| f64::from(known.iter().copied().fold(known[0], pick))),
            Self::Diverging => {
                let rank = (SHOWN * (known.len() - 1) as f64).round() as usize;
                let (_, end, _) =
                    known.select_nth_unstable_by(rank, |a, b| a.abs().total_cmp(&b.abs()));
                let end = f64::from(end.abs());
                [-end, end]
            }
        };
        Some(if high > low { [low, high] } else { [low - 0.5, high + 0.5] })
    }

    pub(super) fn colour(self, share: f64) -> Rgb {
        let gradient = match self {
            Self::Sequential => colorous::VIRIDIS,
            Self::Diverging => colorous::PURPLE_ORANGE,
        };
        let colorous::Color { r, g, b } = gradient.eval_continuous(share.clamp(0.0, 1.0));
        Rgb(r, g, b)
    }
}
