//! Text as outlines, so that it is filled and haloed like any other shape.

use std::sync::LazyLock;

use glam::Vec2;
use tiny_skia::{Path, PathBuilder};
use ttf_parser::{Face, GlyphId, OutlineBuilder};

static FONT: LazyLock<Face<'static>> = LazyLock::new(|| {
    Face::parse(dejavu::sans::regular(), 0).expect("the embedded DejaVu Sans is a font")
});

/// Pixels per font unit at `size` pixels per em.
fn scale(size: f32) -> f32 {
    let height = f32::from(FONT.ascender()) - f32::from(FONT.descender());
    size * (height / f32::from(FONT.units_per_em())) / height
}

/// The glyph of a character; the box for unknown ones if the font has none.
fn glyph(c: char) -> GlyphId {
    FONT.glyph_index(c).unwrap_or_default()
}

/// From the origin of a glyph to that of the next one, in font units.
fn advance(glyph: GlyphId) -> f32 {
    FONT.glyph_hor_advance(glyph).unwrap_or_default().into()
}

/// Width of `text` in pixels at `size` pixels per em.
pub(super) fn width(text: &str, size: f32) -> f32 {
    let scale = scale(size);
    text.chars().map(|c| scale * advance(glyph(c))).sum()
}

/// `text`, or its beginning and an ellipsis, no wider than `limit` pixels.
pub(super) fn fitted(text: &str, size: f32, limit: f32) -> String {
    if width(text, size) <= limit {
        return text.to_owned();
    }
    let scale = scale(size);
    let mut used = width("…", size);
    let kept = text.chars().take_while(|&c| {
        used += scale * advance(glyph(c));
        used <= limit
    });
    kept.chain(['…']).collect()
}

/// The outline of `text` whose baseline begins at `at`; `None` if nothing is visible.
pub(super) fn outline(text: &str, size: f32, at: Vec2) -> Option<Path> {
    let scale = scale(size);
    let mut pen = Pen { path: PathBuilder::new(), scale, at, start: Vec2::ZERO };
    for c in text.chars() {
        let glyph = glyph(c);
        FONT.outline_glyph(glyph, &mut pen);
        pen.at.x += scale * advance(glyph);
    }
    pen.path.finish()
}

/// Draws glyphs into a path.
struct Pen {
    path: PathBuilder,
    scale: f32,
    /// The origin of the glyph, in pixels.
    at: Vec2,
    /// Where the contour began, in pixels.
    start: Vec2,
}

impl Pen {
    /// A point of the glyph: font units run up the page, pixels down.
    fn to_pixels(&self, x: f32, y: f32) -> Vec2 {
        self.at + Vec2::new(self.scale, -self.scale) * Vec2::new(x, y)
    }
}

impl OutlineBuilder for Pen {
    fn move_to(&mut self, x: f32, y: f32) {
        self.start = self.to_pixels(x, y);
        self.path.move_to(self.start.x, self.start.y);
    }

    fn line_to(&mut self, x: f32, y: f32) {
        let p = self.to_pixels(x, y);
        self.path.line_to(p.x, p.y);
    }

    fn quad_to(&mut self, x1: f32, y1: f32, x: f32, y: f32) {
        let [p, q] = [(x1, y1), (x, y)].map(|(x, y)| self.to_pixels(x, y));
        self.path.quad_to(p.x, p.y, q.x, q.y);
    }

    fn curve_to(&mut self, x1: f32, y1: f32, x2: f32, y2: f32, x: f32, y: f32) {
        let [p, q, r] = [(x1, y1), (x2, y2), (x, y)].map(|(x, y)| self.to_pixels(x, y));
        self.path.cubic_to(p.x, p.y, q.x, q.y, r.x, r.y);
    }

    fn close(&mut self) {
        self.path.line_to(self.start.x, self.start.y);
    }
}

/// A number to four significant digits (whole ones are all kept), without trailing zeros.
pub(super) fn number(value: f64) -> String {
    if value == 0.0 {
        return "0".into();
    }
    let magnitude = value.abs().log10().floor() as i32;
    if !(-4..7).contains(&magnitude) {
        return format!("{value:.2e}");
    }
    let decimals = (3 - magnitude).clamp(0, 9) as usize;
    let text = format!("{value:.decimals$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').into() } else { text }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_is_measured_and_fitted() {
        assert!(width("κ = 5 km²", 20.0) > width("5 km", 20.0));
        assert_eq!(fitted("short", 20.0, 1000.0), "short");
        let cut = fitted(&"long ".repeat(100), 20.0, 200.0);
        assert!(cut.ends_with('…') && width(&cut, 20.0) <= 200.0);
        assert!(outline("  ", 20.0, Vec2::ZERO).is_none());
        let bounds = outline("H", 20.0, Vec2::new(10.0, 50.0)).unwrap().bounds();
        assert!((bounds.bottom() - 50.0).abs() < 0.5 && bounds.left() > 10.0);
        // Capital height of DejaVu Sans: 0.729 em.
        assert!((bounds.height() - 14.58).abs() < 0.1, "{}", bounds.height());
    }

    #[test]
    fn numbers_are_short() {
        assert_eq!(number(12_500.0), "12500");
        assert_eq!(number(0.25), "0.25");
        assert_eq!(number(-3.0), "-3");
        assert_eq!(number(2.5e-7), "2.50e-7");
    }
}
