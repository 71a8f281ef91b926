//! Well-known text: its parts by their keywords. What they mean is for [`proj4wkt`].

/// Deepest nesting and most bytes of text that is read: real ones have 8 levels and some kilobytes.
const DEEPEST: usize = 24;
const LONGEST: usize = 1 << 18;

/// Keywords of horizontal CRSs in both versions of well-known text.
const HORIZONTAL: [&str; 8] = [
    "PROJCS",
    "PROJCRS",
    "PROJECTEDCRS",
    "GEOGCS",
    "GEOGCRS",
    "GEOGRAPHICCRS",
    "GEODCRS",
    "GEODETICCRS",
];

/// The horizontal CRS in well-known text, which may stand in a compound one or before a vertical one;
/// `None` if there is none.
pub(super) fn horizontal_crs(text: &str) -> Option<&str> {
    if text.len() > LONGEST {
        return None;
    }
    // Where the keyword of each open bracket begins, the outermost horizontal CRS, and where a word may begin.
    let (mut open, mut outermost, mut word, mut quoted) = (Vec::new(), None, 0, false);
    for (at, c) in text.char_indices() {
        match c {
            '"' => quoted = !quoted,
            _ if quoted => {}
            '[' | '(' if open.len() == DEEPEST => return None,
            '[' | '(' => {
                if outermost.is_none() && is_horizontal(&text[word..at]) {
                    outermost = Some(word);
                }
                open.push(word);
                word = at + 1;
            }
            ']' | ')' => {
                let start = open.pop()?;
                if outermost == Some(start) {
                    return Some(&text[start..=at]);
                }
                word = at + 1;
            }
            _ if c == ',' || c.is_whitespace() => word = at + c.len_utf8(),
            _ => {}
        }
    }
    None
}

fn is_horizontal(keyword: &str) -> bool {
    HORIZONTAL.iter().any(|known| keyword.eq_ignore_ascii_case(known))
}

/// Whether a horizontal CRS is a projected one.
pub(super) fn is_projected(wkt: &str) -> bool {
    wkt.get(..4).is_some_and(|keyword| keyword.eq_ignore_ascii_case("PROJ"))
}

/// The first quoted text of well-known text: what the CRS is called.
pub(super) fn wkt_name(wkt: &str) -> &str {
    wkt.split('"').nth(1).unwrap_or("")
}

/// The name of the geographic CRS, which may be the base of a projected one.
pub(super) fn wkt_geographic_name(wkt: &str) -> Option<&str> {
    name_after(wkt, &["GEOGCS[\"", "GEOGCRS[\"", "GEODCRS[\""])
}

/// The name of the datum, or ensemble of datums.
pub(super) fn wkt_datum(wkt: &str) -> Option<&str> {
    name_after(wkt, &["DATUM[\"", "ENSEMBLE[\"", "TRF[\""])
}

fn name_after<'a>(wkt: &'a str, keywords: &[&str]) -> Option<&'a str> {
    keywords.iter().find_map(|keyword| wkt.split_once(keyword)?.1.split('"').next())
}

/// The last `UNIT["name",size` of well-known text, which is the one of the outermost CRS.
pub(super) fn wkt_unit(wkt: &str) -> Option<(&str, f64)> {
    let (_, unit) = wkt.rsplit_once("UNIT[\"")?;
    let (name, rest) = unit.split_once('"')?;
    let size = rest.trim_start_matches([',', ' ']).split([',', ']']).next()?;
    Some((name, size.trim().parse().ok()?))
}

/// The EPSG code that closes well-known text: `AUTHORITY["EPSG","…"]]`, or in WKT 2 `ID["EPSG",…]]`.
pub(super) fn wkt_authority(wkt: &str) -> Option<u32> {
    let (_, authority) = wkt.rsplit_once("\"EPSG\"")?;
    let digits = authority.trim_start_matches([',', ' ', '"']);
    let (code, rest) = digits.split_at(digits.find(|c: char| !c.is_ascii_digit())?);
    // Only the code of the whole: nothing but closing brackets may follow, and just two of them.
    let brackets: String = rest.chars().filter(|c| *c != '"' && !c.is_whitespace()).collect();
    (brackets == "]]").then(|| code.parse().ok()).flatten()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_horizontal_part_is_found() {
        let utm = r#"PROJCS["a [b",GEOGCS["c"],UNIT["m",1]]"#;
        assert_eq!(horizontal_crs(utm), Some(utm));
        assert_eq!(horizontal_crs(&format!(r#"COMPD_CS["x",{utm},VERT_CS["y"]]"#)), Some(utm));
        assert_eq!(horizontal_crs(&format!(r#"{utm},VERTCS["y",UNIT["Foot",0.3048]]"#)), Some(utm));
        let base = r#"PROJCRS["a",BASEGEOGCRS["b"]]"#;
        assert_eq!(horizontal_crs(&format!("BOUNDCRS[SOURCECRS[{base}]]")), Some(base));
        for none in ["", "PROJCS", "PROJCS[", "]", "LOCAL_CS[\"x\"]", &"[".repeat(1000)] {
            assert_eq!(horizontal_crs(none), None, "{none}");
        }
    }
}
