//! Isolines on a map, and the values written on them.

use glam::Vec2;

use super::colour::Rgb;
use super::layout::MapLayout;
use super::text;
use crate::grid::Isoline;

/// One of this many isolines is thick and labelled.
const MAJOR: usize = 5;
/// Size of the labels of isolines, in pixels of a picture of the default size.
const LABEL: f32 = 17.0;

/// Isolines of one distance.
#[derive(Clone, Debug)]
pub struct IsolineLayer<'a> {
    /// The lines.
    pub isolines: &'a [Isoline],
    /// Their colour.
    pub colour: Rgb,
    /// What the legend says; empty for no entry.
    pub label: String,
}

/// A value written on its isoline.
pub(super) struct Label {
    middle: Vec2,
    half: Vec2,
    text: String,
    colour: Rgb,
}

impl Label {
    /// Whether it leaves a rectangle around `middle` free.
    fn is_apart(&self, middle: Vec2, half: Vec2) -> bool {
        (middle - self.middle).abs().cmpgt(self.half + half).any()
    }

    /// Whether it is on the map, away from `taken` points and from labels that are drawn.
    fn is_free(&self, layout: &MapLayout, taken: &[Vec2], drawn: &[Self]) -> bool {
        let reach = Vec2::splat(10.0 * layout.unit);
        layout.shows(self.middle - self.half)
            && layout.shows(self.middle + self.half)
            && taken.iter().all(|&point| self.is_apart(point, reach))
            && drawn.iter().all(|other| self.is_apart(other.middle, other.half))
    }
}

/// Thin lines, every fifth thicker; and where along each thick one its label may go, best first.
pub(super) fn draw_isolines(layout: &mut MapLayout, layer: &IsolineLayer<'_>) -> Vec<Vec<Label>> {
    let mut labels = Vec::new();
    for (i, isoline) in layer.isolines.iter().enumerate() {
        let lines = layout.lines(&isoline.lines);
        let major = (i + 1) % MAJOR == 0;
        let (width, opacity) = if major { (2.2, 0.8) } else { (1.1, 0.6) };
        layout.canvas.lines(&lines, width * layout.unit, layer.colour, opacity);
        if major && let Some(longest) = lines.iter().max_by_key(|line| line.len()) {
            labels.push(label_places(
                longest,
                &text::number(isoline.level),
                layer.colour,
                layout.unit,
            ));
        }
    }
    labels
}

fn label_places(line: &[Vec2], text: &str, colour: Rgb, unit: f32) -> Vec<Label> {
    let size = LABEL * unit;
    let half = Vec2::new(text::width(text, size) / 2.0 + 4.0 * unit, 0.6 * size);
    [8, 4, 12, 6, 10, 2, 14, 5, 11, 3, 13]
        .map(|sixteenths| line[line.len() * sixteenths / 16])
        .map(|middle| Label { middle, half, text: text.to_owned(), colour })
        .into()
}

/// Draws each label in its first place that is on the map and free of `taken` points and of other
/// labels; a label without such a place is left out.
pub(super) fn draw_labels(layout: &mut MapLayout, labels: Vec<Vec<Label>>, taken: &[Vec2]) {
    let size = LABEL * layout.unit;
    let mut drawn: Vec<Label> = Vec::new();
    for places in labels {
        let free = places.into_iter().find(|label| label.is_free(layout, taken, &drawn));
        if let Some(label) = free {
            let width = text::width(&label.text, size);
            let baseline = label.middle + Vec2::new(-width / 2.0, 0.36 * size);
            layout.canvas.text(&label.text, size, baseline, label.colour, 3.0 * layout.unit);
            drawn.push(label);
        }
    }
}
