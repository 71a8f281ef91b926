//! Text as outlines, so that it is filled and haloed like any other shape.

use std::sync::LazyLock;

use ab_glyph::{Font, FontRef, OutlineCurve, PxScale, PxScaleFont, ScaleFont};
use glam::Vec2;
use tiny_skia::{Path, PathBuilder};

static FONT: LazyLock<FontRef<'static>> = LazyLock::new(|| {
    FontRef::try_from_slice(dejavu::sans::regular()).expect("the embedded DejaVu Sans is a font")
});

fn scaled(size: f32) -> PxScaleFont<&'static FontRef<'static>> {
    let em = FONT.height_unscaled() / FONT.units_per_em().unwrap_or(1.0);
    FONT.as_scaled(PxScale::from(size * em))
}

/// Width of `text` in pixels at `size` pixels per em.
pub(super) fn width(text: &str, size: f32) -> f32 {
    let font = scaled(size);
    text.chars().map(|c| font.h_advance(font.glyph_id(c))).sum()
}

/// `text`, or its beginning and an ellipsis, no wider than `limit` pixels.
pub(super) fn fitted(text: &str, size: f32, limit: f32) -> String {
    if width(text, size) <= limit {
        return text.to_owned();
    }
    let font = scaled(size);
    let mut used = width("…", size);
    let kept = text.chars().take_while(|&c| {
        used += font.h_advance(font.glyph_id(c));
        used <= limit
    });
    kept.chain(['…']).collect()
}

/// The outline of `text` whose baseline begins at `at`; `None` if nothing is visible.
pub(super) fn outline(text: &str, size: f32, at: Vec2) -> Option<Path> {
    let font = scaled(size);
    let mut path = PathBuilder::new();
    let mut pen = at;
    for c in text.chars() {
        let glyph = font.glyph_id(c);
        // Font units run up the page, pixels down.
        let scale = Vec2::new(font.h_scale_factor(), -font.v_scale_factor());
        if let Some(outline) = FONT.outline(glyph) {
            push_curves(&mut path, &outline.curves, |p| pen + scale * Vec2::new(p.x, p.y));
        }
        pen.x += font.h_advance(glyph);
    }
    path.finish()
}

fn push_curves(
    path: &mut PathBuilder,
    curves: &[OutlineCurve],
    place: impl Fn(ab_glyph::Point) -> Vec2,
) {
    let mut end = None;
    for curve in curves {
        let (OutlineCurve::Line(start, _)
        | OutlineCurve::Quad(start, _, _)
        | OutlineCurve::Cubic(start, _, _, _)) = *curve;
        if end != Some(start) {
            let p = place(start);
            path.move_to(p.x, p.y);
        }
        end = Some(match *curve {
            OutlineCurve::Line(_, b) => {
                let p = place(b);
                path.line_to(p.x, p.y);
                b
            }
            OutlineCurve::Quad(_, b, c) => {
                let [p, q] = [b, c].map(&place);
                path.quad_to(p.x, p.y, q.x, q.y);
                c
            }
            OutlineCurve::Cubic(_, b, c, d) => {
                let [p, q, r] = [b, c, d].map(&place);
                path.cubic_to(p.x, p.y, q.x, q.y, r.x, r.y);
                d
            }
        });
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
