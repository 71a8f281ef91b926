//! Every DEM of the conformance corpus: exactly the manifest's values, or a clear refusal where one is due.

use std::fs;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use glam::DVec2;
use ridgeway::terrain::read_bands;
use ridgeway::{Error, Ground, Terrain};
use serde_json::Value;
use sha2::{Digest, Sha256};

/// Files that could be read but are refused, with a word of the message.
const REFUSED: [(&str, &str); 1] = [("geo_rotated_modeltransformation.tif", "rotated")];

/// Longest that any of the small files may take, damaged or not.
const PATIENCE: Duration = Duration::from_secs(5);

fn corpus() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/data/corpus")
}

/// The manifest's entries of the formats that are read.
fn entries() -> Vec<Value> {
    let text = fs::read_to_string(corpus().join("manifest.json")).unwrap();
    let mut manifest: Value = serde_json::from_str(&text).unwrap();
    let Value::Array(files) = manifest["files"].take() else { panic!("no list of files") };
    let read = [".tif", ".asc", ".hgt", ".hgt.gz", ".hgt.zip"];
    files.into_iter().filter(|f| read.iter().any(|e| name(f).ends_with(e))).collect()
}

fn name(entry: &Value) -> &str {
    entry["file"].as_str().unwrap()
}

fn open(path: &Path) -> Result<Terrain, Error> {
    let start = Instant::now();
    let result = Terrain::open(path);
    assert!(start.elapsed() < PATIENCE, "{} took {:?}", path.display(), start.elapsed());
    result
}

#[test]
#[ignore = "needs ../shared"]
fn every_file_gives_its_values_or_is_refused_clearly() {
    let entries = entries();
    assert!(entries.len() > 140, "only {} entries", entries.len());
    let mut faults = Vec::new();
    for entry in &entries {
        let file = name(entry);
        let result = open(&corpus().join(file));
        let refusal = REFUSED.iter().find(|(refused, _)| *refused == file);
        let verdict = match (&result, entry["expect"].as_str().unwrap(), refusal) {
            (Err(e), _, Some((_, word))) if e.to_string().contains(word) => Ok(()),
            (_, _, Some(_)) => Err("should be refused".to_owned()),
            (Ok(terrain), "ok", None) => check(terrain, entry),
            (Ok(_), "error", None) => Err("should be refused".to_owned()),
            (Err(e), "ok", None) => Err(e.to_string()),
            (Err(e), ..)
                if !e.to_string().contains(file) || e.to_string().len() < file.len() + 15 =>
            {
                Err(format!("not a clear message: {e}"))
            }
            _ => Ok(()),
        };
        if let Err(e) = &result {
            println!("refused: {e}");
        }
        faults.extend(verdict.err().map(|fault| format!("{file}: {fault}")));
    }
    assert!(
        faults.is_empty(),
        "{} of {} files:\n{}",
        faults.len(),
        entries.len(),
        faults.join("\n")
    );
}

/// Holds a terrain against its entry.
fn check(terrain: &Terrain, entry: &Value) -> Result<(), String> {
    let frame = terrain.frame();
    let data = &entry["data"];
    let size = (data["rows"].as_u64().unwrap() as usize, data["cols"].as_u64().unwrap() as usize);
    if (frame.rows(), frame.cols()) != size {
        return Err(format!("{} rows × {} columns, not {size:?}", frame.rows(), frame.cols()));
    }
    check_values(&stored(terrain, entry), entry)?;
    check_place(terrain, entry)?;
    check_crs(terrain, entry)?;
    let south_up = entry["south_up"].as_bool().unwrap_or(false);
    if terrain.source().south_up != south_up {
        return Err("south-up not noticed".to_owned());
    }
    let odd = south_up
        || entry["suspicious"].as_bool().unwrap_or(false)
        || entry["bands"].as_u64().unwrap_or(1) > 1
        || data["valid"] == 0;
    if odd && terrain.notes().is_empty() {
        return Err("nothing noted".to_owned());
    }
    Ok(())
}

/// The numbers of the file in its order, by undoing scale, unit and the turning of south-up rows.
fn stored(terrain: &Terrain, entry: &Value) -> Vec<f64> {
    let scale = entry["scale"].as_f64().unwrap_or(1.0);
    let offset = entry["offset"].as_f64().unwrap_or(0.0);
    let unit = entry["z_unit_m"].as_f64().unwrap_or(1.0);
    let dtype = entry["dtype"].as_str().unwrap_or("float32");
    let converted = (scale, offset, unit) != (1.0, 0.0, 1.0);
    let mut values: Vec<f64> = terrain
        .heights()
        .iter()
        .map(|height| match (converted, dtype) {
            (false, _) => *height,
            // The conversion and its inverse round; the stored type tells what the number was.
            (true, "float32") => f64::from(((height / unit - offset) / scale) as f32),
            (true, _) => ((height / unit - offset) / scale).round(),
        })
        .collect();
    if terrain.source().south_up {
        let cols = terrain.frame().cols();
        values = values.chunks(cols).rev().flatten().copied().collect();
    }
    values
}

fn check_values(values: &[f64], entry: &Value) -> Result<(), String> {
    let data = &entry["data"];
    let tolerance = entry["tolerance"].as_f64().unwrap();
    let near = |a: f64, b: &Value| match b.as_f64() {
        Some(b) => (a - b).abs() <= tolerance,
        None => a.is_nan(),
    };
    let valid: Vec<f64> = values.iter().copied().filter(|v| !v.is_nan()).collect();
    if valid.len() as u64 != data["valid"].as_u64().unwrap() {
        return Err(format!("{} valid cells, not {}", valid.len(), data["valid"]));
    }
    let min = valid.iter().copied().fold(f64::NAN, f64::min);
    let max = valid.iter().copied().fold(f64::NAN, f64::max);
    if !near(min, &data["min"]) || !near(max, &data["max"]) {
        return Err(format!("{min} to {max}, not {} to {}", data["min"], data["max"]));
    }
    let cols = data["cols"].as_u64().unwrap() as usize;
    for cell in data["cells"].as_array().into_iter().flatten() {
        let (row, col) = (cell[0].as_u64().unwrap() as usize, cell[1].as_u64().unwrap() as usize);
        let value = values[row * cols + col];
        if !near(value, &cell[2]) {
            return Err(format!("{value} in row {row}, column {col}, not {}", cell[2]));
        }
    }
    let mut hash = Sha256::new();
    for value in values {
        let bits = if value.is_nan() { 0x7ff8_0000_0000_0000 } else { value.to_bits() };
        hash.update(bits.to_le_bytes());
    }
    let hash: String = hash.finalize().iter().map(|b| format!("{b:02x}")).collect();
    if tolerance == 0.0 && data["sha256_f64le"].as_str().is_some_and(|due| due != hash) {
        return Err("the hash of the values differs".to_owned());
    }
    Ok(())
}

fn check_place(terrain: &Terrain, entry: &Value) -> Result<(), String> {
    let Some(transform) = entry["transform_corner"].as_array() else { return Ok(()) };
    let t: Vec<f64> = transform.iter().map(|v| v.as_f64().unwrap()).collect();
    let frame = terrain.frame();
    let rows = frame.rows() as f64;
    // The north-western corner, wherever row 0 of the file was.
    let top = if t[4] > 0.0 { t[5] + t[4] * rows } else { t[5] };
    let found = [
        frame.step().x,
        frame.step().y,
        frame.origin().x - frame.step().x / 2.0,
        frame.origin().y + frame.step().y / 2.0,
    ];
    let due = [t[0], t[4].abs(), t[2], top];
    let close =
        found.iter().zip(due).all(|(f, d)| (f - d).abs() <= 1e-14 * d.abs().max(1.0) * rows);
    if close { Ok(()) } else { Err(format!("step and corner {found:?}, not {due:?}")) }
}

fn check_crs(terrain: &Terrain, entry: &Value) -> Result<(), String> {
    let crs = terrain.crs();
    let epsg = entry["epsg"].as_u64();
    if epsg.is_some() && crs.epsg().map(u64::from) != epsg {
        return Err(format!("EPSG code {:?}, not {epsg:?}", crs.epsg()));
    }
    let kind = match crs {
        crs if crs.is_none() => "none",
        crs if crs.is_geographic() => "geographic",
        _ => "projected",
    };
    if entry["crs_kind"].as_str().is_some_and(|due| due != kind) {
        return Err(format!("CRS of kind {kind}, not {}", entry["crs_kind"]));
    }
    if let Some(unit) = entry["linear_unit_m"].as_f64() {
        let ground = crs.ground();
        if !matches!(ground, Ground::Plane { metres_per_unit } if (metres_per_unit - unit).abs() < 1e-12)
        {
            return Err(format!("ground {ground:?}, not {unit} m per unit"));
        }
    }
    let unit = entry["z_unit_m"].as_f64().unwrap_or(1.0);
    if (terrain.source().metres_per_height_unit - unit).abs() > 1e-12 {
        return Err(format!("height unit {}", terrain.source().height_unit));
    }
    // Places go to longitude and latitude and back, also on the Moon and in CRSs spelled out by their keys.
    if kind != "none" {
        let place = DVec2::splat(0.5);
        let lonlat = terrain.to_lonlat(place).map_err(|e| e.to_string())?;
        let back = terrain.from_lonlat(lonlat).map_err(|e| e.to_string())?;
        if (back - place).length() > 1e-3 {
            return Err(format!("{place} went to {lonlat} and came back as {back}"));
        }
    }
    Ok(())
}

#[test]
#[ignore = "needs ../shared"]
fn all_bands_are_read() {
    let pixel = read_bands(corpus().join("multi_band_pixel.tif")).unwrap();
    let planar = read_bands(corpus().join("multi_band_planar.tif")).unwrap();
    assert_eq!((pixel.bands.len(), planar.bands.len()), (3, 2));
    for raster in [&pixel, &planar] {
        assert!(raster.bands.iter().all(|b| b.len() == raster.frame.nodes()));
        assert_ne!(raster.bands[0], raster.bands[1]);
    }
}

#[test]
#[ignore = "needs ../shared"]
fn real_terrains_are_where_they_should_be() {
    let dem = corpus().join("../dem");
    // The middle of each as known from maps: Mount St. Helens, Andorra, its SRTM tile, the far side of the
    // Moon (rows of the equirectangular map about 180° E at 16 cells a degree).
    for (file, lon, lat) in [
        ("st_helens_utm10n_30m.tif", -122.19, 46.20),
        ("andorra_utm31n_75m.tif", 1.55, 42.55),
        ("N42E001.hgt", 1.5, 42.5),
        ("moon_lola_korolev_1895m.tif", -150.0, 0.0),
    ] {
        let terrain = open(&dem.join(file)).unwrap();
        let frame = terrain.frame();
        let middle = DVec2::new(frame.cols() as f64, frame.rows() as f64) / 2.0;
        let place = terrain.to_lonlat(middle).unwrap();
        println!("{file}: {place} {:?} {:?}", terrain.statistics(), terrain.notes());
        assert!((place - DVec2::new(lon, lat)).abs().max_element() < 0.2, "{file}: {place}");
    }
}

/// A small generator, so that the same files are made every time.
struct Random(u64);

impl Random {
    fn below(&mut self, n: usize) -> usize {
        self.0 =
            self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) as usize % n.max(1)
    }
}

#[test]
#[ignore = "needs ../shared"]
fn damaged_files_neither_panic_nor_hang() {
    let folder = tempfile::tempdir().unwrap();
    let mut random = Random(1);
    for entry in &entries() {
        let file = name(entry);
        let whole = fs::read(corpus().join(file)).unwrap();
        if file.contains('/') || whole.len() > 70_000 {
            continue;
        }
        let path = folder.path().join(file);
        let open_as = |bytes: &[u8]| {
            fs::write(&path, bytes).unwrap();
            // Read or refused, as long as it comes back.
            let _ = open(&path);
            let _ = read_bands(&path);
        };
        for _ in 0..15 {
            open_as(&whole[..random.below(whole.len())]);
        }
        // Most flips hit what describes the file: its first or last 500 bytes.
        for round in 0..40 {
            let mut bytes = whole.clone();
            for _ in 0..1 + round % 4 {
                let near = random.below(bytes.len().min(500));
                let at = [near, bytes.len().saturating_sub(1 + near), random.below(bytes.len())];
                if let Some(byte) = bytes.get_mut(at[random.below(3)]) {
                    *byte = random.below(256) as u8;
                }
            }
            open_as(&bytes);
        }
    }
}
