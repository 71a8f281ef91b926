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
        9040 => ("British yard (Sears 1922)", 0.914_398_414_616_029),
        9041 => ("British foot (Sears 1922)", 0.304_799_471_538_676),
        9080 => ("Indian foot", 0.304_799_510_248_146_94),
        9084 => ("Indian yard", 0.914_398_530_744_441),
        9093 => ("statute mile", 1609.344),
        9094 => ("Gold Coast foot", 0.304_799_710_181_509),
        9096 => ("yard", 0.9144),
        _ => return None,
    })
}

/// Degrees of an EPSG unit of angle that numbers may be given in.
pub(super) fn angle_unit(code: u16) -> Option<f64> {
    Some(match code {
        9101 => 1f64.to_degrees(),
        9102 | 9122 => 1.0,
        9103 => 1.0 / 60.0,
        9104 => 1.0 / 3600.0,
        9105 | 9106 => 0.9,
        _ => return None,
    })
}
