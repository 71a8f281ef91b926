//! Units of length: their names, sizes and EPSG codes.

/// Name of a unit of length by its size in metres.
pub(super) fn unit_name(metres: f64) -> String {
    let named = [
        (1.0, "metre"),
        (0.3048, "foot"),
        (1200.0 / 3937.0, "US survey foot"),
        (1000.0, "kilometre"),
    ];
    match named.iter().find(|(size, _)| (size - metres).abs() < 1e-9 * size) {
        Some((_, name)) => (*name).to_owned(),
        None => format!("unit of {metres} m"),
    }
}

/// Name and metres of an EPSG unit of length.
pub(in crate::terrain) fn length_unit(code: u16) -> Option<(&'static str, f64)> {
    Some(match code {
        9001 => ("metre", 1.0),
        9002 => ("foot", 0.3048),
        9003 => ("US survey foot", 1200.0 / 3937.0),
        9005 => ("Clarke's foot", 0.304_797_265_4),
        9036 => ("kilometre", 1000.0),
        _ => return None,
    })
}
