//! Values of flags, parsed.

use glam::DVec2;
use ridgeway::plan::Place;
use ridgeway::{Delta, Error, Smoothing};

/// A flag's value, `None` for `auto`. Called `Option`, clap would take it for a flag that may be left out.
pub(super) type OrAuto<T> = Option<T>;

/// A place: X,Y, lonlat:LON,LAT, pixel:COL,ROW or a file.
pub(super) fn place(text: &str) -> Result<Place, String> {
    text.parse().map_err(|error| match error {
        Error::Argument(mismatch) => format!("expected {}", mismatch.expected.unwrap_or_default()),
        error => error.to_string(),
    })
}

/// Two finite numbers `X,Y`.
pub(super) fn pair(text: &str) -> Result<DVec2, String> {
    let number = |part: &str| part.trim().parse::<f64>().ok().filter(|v| v.is_finite());
    text.split_once(',')
        .and_then(|(x, y)| Some(DVec2::new(number(x)?, number(y)?)))
        .ok_or_else(|| "expected two numbers, for example 388400,4711200".into())
}

fn number(text: &str, good: impl Fn(f64) -> bool, expected: &str) -> Result<f64, String> {
    match text.trim().parse() {
        Ok(value) if f64::is_finite(value) && good(value) => Ok(value),
        _ => Err(format!("expected {expected}")),
    }
}

pub(super) fn positive(text: &str) -> Result<f64, String> {
    number(text, |v| v > 0.0, "a number above 0")
}

pub(super) fn not_negative(text: &str) -> Result<f64, String> {
    number(text, |v| v >= 0.0, "a number, 0 or more")
}

pub(super) fn share(text: &str) -> Result<f64, String> {
    number(text, |v| (0.0..=1.0).contains(&v), "a number between 0 and 1")
}

pub(super) fn slope(text: &str) -> Result<f64, String> {
    number(text, |v| v > 0.0 && v <= 90.0, "an angle above 0 and up to 90 degrees")
}

/// Most cells of a synthetic terrain: 2 GB of heights.
const MOST_CELLS: usize = 1 << 28;

pub(super) fn size(text: &str) -> Result<(usize, usize), String> {
    let count = |part: &str| part.trim().parse::<usize>().ok().filter(|&n| n > 0);
    text.split_once(['x', 'X', '×'])
        .and_then(|(cols, rows)| Some((count(cols)?, count(rows)?)))
        .filter(|(cols, rows)| cols.checked_mul(*rows).is_some_and(|cells| cells <= MOST_CELLS))
        .ok_or_else(|| {
            format!(
                "expected columns and rows, for example 301x201, and at most {MOST_CELLS} cells"
            )
        })
}

pub(super) fn epsg(text: &str) -> Result<u32, String> {
    let code = match text.split_at_checked(5) {
        Some((prefix, code)) if prefix.eq_ignore_ascii_case("epsg:") => code,
        _ => text,
    };
    code.parse().map_err(|_| "expected an EPSG code, for example EPSG:32631".into())
}

pub(super) fn smoothing(text: &str) -> Result<Smoothing, String> {
    const EXPECTED: &str = "a length in metres, a number of cells such as 16cells, auto, or 0";
    if text == "auto" {
        return Ok(Smoothing::Auto);
    }
    if let Some(cells) = text.strip_suffix("cells") {
        return number(cells, |v| v > 0.0, EXPECTED).map(Smoothing::CutoffCells);
    }
    let metres = number(text.strip_suffix('m').unwrap_or(text), |v| v >= 0.0, EXPECTED)?;
    Ok(if metres == 0.0 { Smoothing::Interpolate } else { Smoothing::Cutoff(metres) })
}

pub(super) fn delta(text: &str) -> Result<OrAuto<Delta>, String> {
    auto_or(text, "auto, auto:SHARE, or a curvature above 0 in 1/m such as 0.001")
}

pub(super) fn difference_delta(text: &str) -> Result<OrAuto<Delta>, String> {
    auto_or(text, "auto, auto:SHARE, or a number above 0")
}

fn auto_or(text: &str, expected: &str) -> Result<OrAuto<Delta>, String> {
    let positive = |text| number(text, |v| v > 0.0, expected);
    match text.strip_prefix("auto") {
        Some("") => Ok(None),
        Some(share) => positive(share.strip_prefix(':').unwrap_or("")).map(Delta::Auto).map(Some),
        None => positive(text).map(Delta::Absolute).map(Some),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_with_units_parse() {
        assert_eq!(smoothing("0"), Ok(Smoothing::Interpolate));
        assert_eq!(smoothing("16cells"), Ok(Smoothing::CutoffCells(16.0)));
        assert_eq!(smoothing("480m"), Ok(Smoothing::Cutoff(480.0)));
        assert_eq!(smoothing("auto"), Ok(Smoothing::Auto));
        assert!(
            smoothing("-3").is_err() && smoothing("cells").is_err() && smoothing("NaN").is_err()
        );
        assert_eq!(delta("auto"), Ok(None));
        assert_eq!(delta("auto:0.05"), Ok(Some(Delta::Auto(0.05))));
        assert_eq!(delta("1e-3"), Ok(Some(Delta::Absolute(1e-3))));
        assert!(delta("0").is_err() && delta("autos").is_err() && delta("inf").is_err());
        assert_eq!(size("30x20"), Ok((30, 20)));
        assert!(size("30").is_err() && size("0x3").is_err() && size("-1x3").is_err());
        assert_eq!(epsg("EPSG:32631"), Ok(32631));
        assert_eq!(epsg("32631"), Ok(32631));
        assert!(epsg("EPSG:").is_err() && epsg("äöü").is_err());
    }
}
