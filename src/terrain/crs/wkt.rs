//! Well-known text: the name, unit, EPSG code and ellipsoid in it, without a parser.

/// The first quoted text of well-known text: what the CRS is called.
pub(super) fn wkt_name(wkt: &str) -> &str {
    wkt.split('"').nth(1).unwrap_or("")
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
    let wkt = wkt.trim_end();
    let (_, authority) = wkt.rsplit_once("\"EPSG\"")?;
    let digits = authority.trim_start_matches([',', ' ', '"']);
    let (code, rest) = digits.split_at(digits.find(|c: char| !c.is_ascii_digit())?);
    // Only the code of the whole: nothing but closing brackets may follow, and just two of them.
    (rest.trim_start_matches('"').trim() == "]]").then(|| code.parse().ok()).flatten()
}

/// The `SPHEROID["name",a,1/f` of well-known text in PROJ.4 notation.
pub(super) fn wkt_ellipsoid(wkt: &str) -> Option<String> {
    let (_, spheroid) = wkt.split_once("SPHEROID[").or_else(|| wkt.split_once("ELLIPSOID["))?;
    let mut numbers = spheroid.split([',', ']']).skip(1).map(|t| t.trim().parse::<f64>().ok());
    let a = numbers.next()??;
    let inverse_flattening = numbers.next()??;
    Some(if inverse_flattening > 1.0 {
        format!("+a={a} +rf={inverse_flattening}")
    } else {
        format!("+R={a}")
    })
}

/// EPSG code of a geographic CRS by a name such as `GCS_WGS_1984`.
pub(super) fn geographic_code(name: &str) -> Option<u32> {
    Some(match name {
        "GCS_WGS_1984" | "WGS 84" => 4326,
        "GCS_North_American_1983" | "NAD83" => 4269,
        "GCS_North_American_1927" | "NAD27" => 4267,
        "GCS_ETRS_1989" | "ETRS89" => 4258,
        _ => return None,
    })
}

/// EPSG code of a UTM zone by a name such as `WGS_1984_UTM_Zone_11N` or `NAD27 / UTM zone 10N`.
pub(super) fn utm_code(name: &str) -> Option<u32> {
    const DATUMS: [(&str, u32); 8] = [
        ("WGS 84", 32600),
        ("WGS 1984", 32600),
        ("NAD83", 26900),
        ("NAD 1983", 26900),
        ("NAD27", 26700),
        ("NAD 1927", 26700),
        ("ETRS89", 25800),
        ("ETRS 1989", 25800),
    ];
    let name = name.to_ascii_uppercase().replace('_', " ");
    let (datum, zone) = name.split_once("UTM ZONE ")?;
    let datum = datum.trim_end_matches([' ', '/']);
    let (_, base) = DATUMS.iter().find(|(name, _)| *name == datum)?;
    let (number, hemisphere) =
        zone.trim_end().split_at_checked(zone.trim_end().len().checked_sub(1)?)?;
    let number: u32 = number.parse().ok().filter(|n| (1..=60).contains(n))?;
    match hemisphere {
        "N" => Some(base + number),
        "S" if *base == 32600 => Some(32700 + number),
        _ => None,
    }
}
