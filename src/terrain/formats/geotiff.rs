//! GeoTIFF: what the samples of a TIFF mean, and where they lie.
//!
//! References: *OGC GeoTIFF Standard* (OGC 19-008r4); the GDAL GeoTIFF driver page for the tags `GDAL_NODATA`
//! and `GDAL_METADATA`, internal masks, sparse files and world files.

use std::fs;
use std::path::Path;

use glam::DVec2;
use rayon::prelude::*;

use super::auxiliary::Auxiliary;
use super::format::{Format, ReadMode};
use super::tiff::{
    Directory, Layout, Sample, Tiff, TiffError, TiffResult, damaged, is_tiff, tag, unsupported,
};
use crate::error::Remedy;
use crate::terrain::Source;
use crate::terrain::crs::{Crs, GeoKeys, key, length_unit};
use crate::terrain::raster::{Raster, note_of_fill};

pub(super) const FORMAT: Format = Format {
    name: "GeoTIFF",
    is_own: |head| is_tiff(head.bytes),
    extensions: &[],
    read: |path, bytes, mode| read_image(path, bytes, mode).map_err(|error| error.in_file(path)),
};

fn read_image(path: &Path, bytes: &[u8], mode: ReadMode) -> TiffResult<Raster> {
    let images = Directory::all(Tiff::new(bytes)?)?;
    let mut notes = Vec::new();
    let image = full_resolution(&images, &mut notes)?;
    let layout = Layout::new(image)?;
    refuse_pictures(image, &layout)?;

    let keys = geo_keys(image)?;
    let auxiliary = Auxiliary::of(path);
    let metadata = image.text(tag::GDAL_METADATA)?.unwrap_or_default();
    let unit = match mode {
        ReadMode::Heights => height_unit(&keys, &metadata, &auxiliary)?,
        ReadMode::Bands => None,
    };
    let Placement { origin, step } = place(path, image, &keys, layout.rows, &mut notes)?;
    let crs = match auxiliary.crs() {
        Some(crs) => crs,
        None => Crs::from_geo_keys(keys).map_err(TiffError::Crs)?,
    };
    let alpha = alpha_band(image, &layout)?;
    let count = layout.bands - usize::from(alpha.is_some());
    if mode == ReadMode::Heights && count > 1 {
        notes.push(format!("the file has {count} bands; the first is taken for the height"));
    }
    let bands = match mode {
        ReadMode::Heights => 0..1,
        ReadMode::Bands => 0..count,
    };
    let nodata = image.text(tag::GDAL_NODATA)?.map(|t| t.trim().to_owned());
    let nodata = auxiliary.nodata(0).map(str::to_owned).or(nodata);
    let mask = Mask::new(path, &images, &layout, alpha.filter(|_| nodata.is_none()))?;
    let absent = if nodata.is_some() { f64::NAN } else { 0.0 };
    let bands = bands
        .map(|band| {
            let mut values = layout.band(band, absent)?;
            let nodata = auxiliary.nodata(band).or(nodata.as_deref());
            void_nodata(&mut values, layout.sample, nodata, &mask, &mut notes);
            scale(&mut values, &metadata, &auxiliary, band)?;
            Ok(values)
        })
        .collect::<TiffResult<_>>()?;
    let says_height_unit = unit.is_some();
    let (height_unit, metres_per_height_unit) = unit.unwrap_or(("metre", 1.0));
    Ok(Raster {
        cols: layout.cols,
        rows: layout.rows,
        origin,
        step,
        crs,
        bands,
        source: Source {
            format: FORMAT.name.to_owned(),
            sample: layout.sample.name(),
            height_unit: height_unit.to_owned(),
            metres_per_height_unit,
            nodata,
            south_up: false,
        },
        says_height_unit,
        notes,
    })
}

/// Bits of `NewSubfileType`.
const REDUCED: u64 = 1;
const MASK: u64 = 4;

/// The first image that is neither a thumbnail, nor an overview, nor a mask.
fn full_resolution<'a, 'b>(
    images: &'b [Directory<'a>],
    notes: &mut Vec<String>,
) -> TiffResult<&'b Directory<'a>> {
    let mut whole = Vec::new();
    for image in images {
        if image.uint(tag::NEW_SUBFILE_TYPE, 0)? & (REDUCED | MASK) == 0 {
            whole.push(image);
        }
    }
    if whole.len() > 1 {
        notes.push(format!("the file has {} images; the first is read", whole.len()));
    }
    Ok(whole.first().copied().unwrap_or(&images[0]))
}

/// Refuses samples that are no heights.
fn refuse_pictures(image: &Directory, layout: &Layout) -> TiffResult<()> {
    match (image.uint(tag::PHOTOMETRIC, 1)?, layout.sample) {
        (_, Sample::Packed(1)) => unsupported("one bit per sample: a mask, not heights", HEIGHTS),
        // Neither 0, white is lowest, nor 1, black is lowest, changes a height.
        (0 | 1, _) => Ok(()),
        // GDAL calls three floating-point bands RGB if told so, and they may well be a tensor.
        (2, sample) if sample.is_float() => Ok(()),
        (2, _) => unsupported("an RGB picture, not heights", Remedy::TakeBand),
        (3, _) => unsupported(
            "a palette picture, whose numbers are indexes of colours, not heights",
            HEIGHTS,
        ),
        (4, _) => unsupported("a transparency mask, not heights", HEIGHTS),
        (other, _) => unsupported(
            format!("a picture (photometric interpretation {other}), not heights"),
            HEIGHTS,
        ),
    }
}

const HEIGHTS: &str = "a file of heights is needed";

/// The GeoKeys; none at all if the image has no directory of them.
fn geo_keys(image: &Directory) -> TiffResult<GeoKeys> {
    let directory = image.uints(tag::GEO_KEY_DIRECTORY)?.unwrap_or_default();
    Ok(GeoKeys {
        directory: directory.into_iter().map(|v| v as u16).collect(),
        doubles: image.doubles(tag::GEO_DOUBLE_PARAMS)?,
        ascii: image.text_bytes(tag::GEO_ASCII_PARAMS)?.unwrap_or_default().to_vec(),
    })
}

/// Where the cells lie on the map.
struct Placement {
    /// The centre of the first cell.
    origin: DVec2,
    /// Map units per column and per stored row.
    step: DVec2,
}

impl Placement {
    /// # Errors
    /// A step that is not a finite number other than 0.
    fn new(origin: DVec2, step: DVec2) -> TiffResult<Self> {
        if step.is_finite() && step.abs().min_element() > 0.0 {
            Ok(Self { origin, step })
        } else {
            let found = format!("{} × {}", step.x, step.y);
            damaged("the cell size", found, "finite and not zero")
        }
    }
}

fn rotated<T>() -> TiffResult<T> {
    unsupported("a grid that is rotated or sheared against the map", Remedy::TurnNorthUp)
}

/// The place that the tags give, else a world file, else none: cells of 1 × 1 at the origin.
fn place(
    path: &Path,
    image: &Directory,
    keys: &GeoKeys,
    rows: usize,
    notes: &mut Vec<String>,
) -> TiffResult<Placement> {
    // Tie points give the centre of a cell, not its corner.
    let is_point = keys.short(key::RASTER_TYPE) == Some(2);
    if let Some(placement) = placement(image, is_point)? {
        return Ok(placement);
    }
    if let Some(placement) = world_file(path)? {
        return Ok(placement);
    }
    notes.push(
        "the file has no place on a map: cells of 1 × 1 at the origin are assumed".to_owned(),
    );
    Placement::new(DVec2::new(0.5, rows as f64 - 0.5), DVec2::new(1.0, -1.0))
}

/// What the tags of the image say of its place; `None` if nothing.
fn placement(image: &Directory, is_point: bool) -> TiffResult<Option<Placement>> {
    let half = if is_point { 0.0 } else { 0.5 };
    let matrix = image.doubles(tag::MODEL_TRANSFORMATION)?;
    if let [a, b, _, x, d, e, _, y, ..] = matrix[..] {
        // Rounding in the writer leaves tiny entries; a real rotation moves the far corner by much more.
        if b.abs() > 1e-9 * e.abs() || d.abs() > 1e-9 * a.abs() {
            return rotated();
        }
        let step = DVec2::new(a, e);
        return Placement::new(DVec2::new(x, y) + half * step, step).map(Some);
    }
    let scale = image.doubles(tag::MODEL_PIXEL_SCALE)?;
    let ties = image.doubles(tag::MODEL_TIE_POINT)?;
    match (&scale[..], &ties[..]) {
        ([sx, sy, ..], [i, j, _, x, y, ..]) => {
            let step = DVec2::new(*sx, -sy);
            let first = DVec2::splat(half) - DVec2::new(*i, *j);
            Placement::new(DVec2::new(*x, *y) + step * first, step).map(Some)
        }
        ([], [_, _, _, _, _, _, _, ..]) => {
            unsupported("a grid that is placed by ground control points", Remedy::Rectify)
        }
        _ => Ok(None),
    }
}

/// What a world file beside says, in six lines: x per column, y per column, x per row, y per row, and x and y
/// of the centre of the first cell; `None` if there is no such file.
fn world_file(path: &Path) -> TiffResult<Option<Placement>> {
    let beside = ["tfw", "TFW", "tifw", "wld"].map(|extension| path.with_extension(extension));
    let Some((file, text)) =
        beside.iter().find_map(|file| Some((file, fs::read_to_string(file).ok()?)))
    else {
        return Ok(None);
    };
    let numbers: Vec<f64> = text.split_whitespace().map_while(|t| t.parse().ok()).collect();
    match numbers[..] {
        [a, 0.0, 0.0, e, x, y] => Placement::new(DVec2::new(x, y), DVec2::new(a, e)).map(Some),
        [_, _, _, _, _, _] => rotated(),
        _ => {
            let what = format!("the world file {}", file.display());
            damaged(what, format!("a file of {} numbers", numbers.len()), "one of six")
        }
    }
}

/// Cells that a thread takes at a time.
const PART: usize = 1 << 14;

/// Turns nodata, infinite and masked cells to `NaN`, and notes what looks like nodata but is not declared.
fn void_nodata(
    values: &mut [f64],
    sample: Sample,
    nodata: Option<&str>,
    mask: &Mask,
    notes: &mut Vec<String>,
) {
    let nodata = nodata.and_then(|text| match text.replace(',', ".").parse::<f64>() {
        // A value out of the range of the samples is not met, as it should be.
        Ok(nodata) => Some(sample.round(nodata)),
        Err(_) => {
            notes.push(format!("the nodata value `{text}` is not a number and was left alone"));
            None
        }
    });
    values
        .par_chunks_mut(PART)
        .enumerate()
        .for_each(|(part, values)| void_part(values, part * PART, nodata, mask));
    notes.extend(note_of_fill(values));
}

/// Turns nodata, infinite and masked cells of a part, which begins at cell `first`, to `NaN`.
fn void_part(values: &mut [f64], first: usize, nodata: Option<f64>, mask: &Mask) {
    for (i, value) in values.iter_mut().enumerate() {
        let is_nodata = nodata.is_some_and(|nodata| is_nodata(*value, nodata));
        if is_nodata || value.is_infinite() || mask.is_void(first + i) {
            *value = f64::NAN;
        }
    }
}

/// Equal but for rounding in text, as GDAL has it (`ARE_REAL_EQUAL`).
fn is_nodata(value: f64, nodata: f64) -> bool {
    value == nodata || (value - nodata).abs() < 1e-10 * nodata.abs()
}

/// Rasters of the size of the image that are 0 where a cell is void.
struct Mask(Vec<Vec<f64>>);

impl Mask {
    /// The masks in the file, the one in a file `….msk` beside it, and the alpha band that is given.
    fn new(
        path: &Path,
        images: &[Directory],
        layout: &Layout,
        alpha: Option<usize>,
    ) -> TiffResult<Self> {
        let mut masks = Vec::new();
        for image in images {
            if image.uint(tag::NEW_SUBFILE_TYPE, 0)? & (REDUCED | MASK) == MASK {
                masks.extend(Self::of_size(image, layout)?);
            }
        }
        let mut beside = path.as_os_str().to_owned();
        beside.push(".msk");
        if masks.is_empty()
            && let Ok(bytes) = fs::read(&beside)
            && is_tiff(&bytes)
        {
            let image = Directory::all(Tiff::new(&bytes)?)?;
            masks.extend(Self::of_size(&image[0], layout)?);
        }
        if let Some(alpha) = alpha {
            masks.push(layout.band(alpha, 0.0)?);
        }
        Ok(Self(masks))
    }

    /// The first band of a mask, if it has as many cells as the image.
    fn of_size(image: &Directory, layout: &Layout) -> TiffResult<Option<Vec<f64>>> {
        let mask = Layout::new(image)?;
        let fits = (mask.cols, mask.rows) == (layout.cols, layout.rows);
        fits.then(|| mask.band(0, 0.0)).transpose()
    }

    fn is_void(&self, cell: usize) -> bool {
        self.0.iter().any(|mask| mask[cell] == 0.0)
    }
}

/// The band that says how opaque a cell is; it is the last, if there is one.
fn alpha_band(image: &Directory, layout: &Layout) -> TiffResult<Option<usize>> {
    /// Values of `ExtraSamples` for associated and unassociated alpha (TIFF 6.0, section 18).
    const ALPHA: [u64; 2] = [1, 2];
    let extra = image.uints(tag::EXTRA_SAMPLES)?.unwrap_or_default();
    let is_alpha = layout.bands > 1 && extra.last().is_some_and(|last| ALPHA.contains(last));
    Ok(is_alpha.then(|| layout.bands - 1))
}

/// Text of the item of `GDAL_METADATA` with a role, for one band.
fn metadata_item<'a>(metadata: &'a str, role: &str, band: usize) -> Option<&'a str> {
    let role = format!("role=\"{role}\"");
    let sample = format!("sample=\"{band}\"");
    metadata.split("<Item ").skip(1).find_map(|item| {
        let (attributes, rest) = item.split_once('>')?;
        let text = rest.split_once('<')?.0;
        (attributes.contains(&role) && attributes.contains(&sample)).then(|| text.trim())
    })
}

/// The number with a role in `GDAL_METADATA`, for one band; `None` if there is no such item.
fn metadata_number(metadata: &str, role: &str, band: usize) -> TiffResult<Option<f64>> {
    let Some(text) = metadata_item(metadata, role, band) else { return Ok(None) };
    match text.parse::<f64>() {
        Ok(value) if value.is_finite() => Ok(Some(value)),
        _ => damaged(format!("the {role} in GDAL_METADATA"), format!("`{text}`"), "a number"),
    }
}

/// Turns stored numbers `v` into what they stand for: `scale · v + offset`.
fn scale(values: &mut [f64], metadata: &str, auxiliary: &Auxiliary, band: usize) -> TiffResult<()> {
    let scale = match auxiliary.scale(band) {
        Some(scale) => scale,
        None => metadata_number(metadata, "scale", band)?.unwrap_or(1.0),
    };
    let offset = match auxiliary.offset(band) {
        Some(offset) => offset,
        None => metadata_number(metadata, "offset", band)?.unwrap_or(0.0),
    };
    if (scale, offset) != (1.0, 0.0) {
        values.par_iter_mut().for_each(|v| *v = scale * *v + offset);
    }
    Ok(())
}

/// Name and metres of the unit of the heights: the band's own, else that of the vertical CRS.
fn height_unit(
    keys: &GeoKeys,
    metadata: &str,
    auxiliary: &Auxiliary,
) -> TiffResult<Option<(&'static str, f64)>> {
    let of_band = auxiliary.unit(0).or_else(|| metadata_item(metadata, "unittype", 0));
    if let Some(text) = of_band.filter(|t| !t.is_empty()) {
        return match named_unit(text) {
            Some(unit) => Ok(Some(unit)),
            None => unsupported(
                format!("heights in the unit `{text}`, which is not known"),
                Remedy::ScaleToMetres,
            ),
        };
    }
    if let Some(code) = keys.short(key::VERTICAL_UNITS).filter(|c| *c != 32767) {
        return match length_unit(code) {
            Some(unit) => Ok(Some(unit)),
            None => unsupported(
                format!("heights in the unit EPSG:{code}, which is not known"),
                Remedy::ScaleToMetres,
            ),
        };
    }
    Ok(keys.short(key::VERTICAL_CRS).and_then(|code| match code {
        // EPSG: NGVD29, NAVD88 and mean sea level in US survey feet; NAVD88 and mean sea level in feet.
        5702 | 6360 | 8052 => length_unit(9003),
        8228 | 8050 => length_unit(9002),
        _ => None,
    }))
}

/// Name and metres of the unit that a file calls `name`.
fn named_unit(name: &str) -> Option<(&'static str, f64)> {
    let name = name.to_ascii_lowercase().replace(['_', '-'], " ");
    let name = name.trim();
    match name {
        "m" | "metre" | "metres" | "meter" | "meters" => length_unit(9001),
        "ft" | "foot" | "feet" | "international foot" | "international feet" => length_unit(9002),
        "us ft" | "usft" | "ftus" | "us foot" | "us feet" | "us survey foot" | "us survey feet"
        | "foot us" => length_unit(9003),
        "cm" | "centimetre" | "centimeter" => Some(("centimetre", 0.01)),
        "dm" | "decimetre" | "decimeter" => Some(("decimetre", 0.1)),
        "mm" | "millimetre" | "millimeter" => Some(("millimetre", 0.001)),
        "km" | "kilometre" | "kilometer" => Some(("kilometre", 1000.0)),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::Result;
    use crate::terrain::HeightUnit;

    /// A little-endian TIFF of one uncompressed strip, with further tags of shorts, doubles or text.
    struct Writer {
        entries: Vec<(u16, u16, u32, Vec<u8>)>,
    }

    impl Writer {
        fn new(cols: u16, bits: u16, format: u16, data: &[u8]) -> Self {
            let rows = (data.len() * 8 / usize::from(bits * cols)) as u16;
            let mut writer = Self { entries: Vec::new() };
            for (tag, value) in [
                (tag::IMAGE_WIDTH, cols),
                (tag::IMAGE_LENGTH, rows),
                (tag::BITS_PER_SAMPLE, bits),
                (tag::PHOTOMETRIC, 1),
                (tag::SAMPLE_FORMAT, format),
                (tag::STRIP_BYTE_COUNTS, data.len() as u16),
            ] {
                writer = writer.shorts(tag, &[value]);
            }
            writer.entries.push((tag::STRIP_OFFSETS, 4, 0, data.to_vec()));
            writer
        }

        fn shorts(mut self, tag: u16, values: &[u16]) -> Self {
            self.entries.retain(|entry| entry.0 != tag);
            let bytes = values.iter().flat_map(|v| v.to_le_bytes()).collect();
            self.entries.push((tag, 3, values.len() as u32, bytes));
            self
        }

        fn doubles(mut self, tag: u16, values: &[f64]) -> Self {
            let bytes = values.iter().flat_map(|v| v.to_le_bytes()).collect();
            self.entries.push((tag, 12, values.len() as u32, bytes));
            self
        }

        fn text(mut self, tag: u16, text: &str) -> Self {
            self.entries.push((tag, 2, text.len() as u32 + 1, [text.as_bytes(), b"\0"].concat()));
            self
        }

        fn bytes(&self) -> Vec<u8> {
            let mut head = b"II\x2a\0\x08\0\0\0".to_vec();
            head.extend((self.entries.len() as u16).to_le_bytes());
            let after = head.len() + 12 * self.entries.len() + 4;
            let mut tail: Vec<u8> = Vec::new();
            for (tag, kind, count, bytes) in &self.entries {
                let offset = ((after + tail.len()) as u32).to_le_bytes();
                head.extend(tag.to_le_bytes());
                head.extend(kind.to_le_bytes());
                // The strip is one value, the place of the data.
                head.extend(count.max(&1).to_le_bytes());
                if bytes.len() <= 4 && *count > 0 {
                    let mut inline = bytes.clone();
                    inline.resize(4, 0);
                    head.extend(inline);
                } else {
                    head.extend(offset);
                    tail.extend(bytes);
                }
            }
            head.extend([0; 4]);
            head.extend(tail);
            head
        }

        fn read(&self) -> Result<Raster> {
            (FORMAT.read)(Path::new("dem.tif"), &self.bytes(), ReadMode::Heights)
        }

        fn refusal(&self) -> String {
            self.read().unwrap_err().to_string()
        }
    }

    fn int16(values: &[i16]) -> Writer {
        let data: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        Writer::new(2, 16, 2, &data)
    }

    const UTM: [u16; 16] = [1, 1, 0, 3, 1024, 0, 1, 1, 1025, 0, 1, 1, 3072, 0, 1, 32631];

    #[test]
    fn tie_points_give_corners_or_centres() {
        let placed = |area_or_point| {
            let mut keys = UTM;
            keys[11] = area_or_point;
            let writer = int16(&[1, 2, 3, 4, 5, 6])
                .doubles(tag::MODEL_PIXEL_SCALE, &[30.0, 60.0, 0.0])
                .doubles(tag::MODEL_TIE_POINT, &[1.0, 1.0, 0.0, 400_030.0, 4_700_000.0, 0.0])
                .shorts(tag::GEO_KEY_DIRECTORY, &keys);
            writer.read().unwrap()
        };
        let area = placed(1);
        assert_eq!(area.origin, DVec2::new(400_015.0, 4_700_030.0));
        assert_eq!(area.step, DVec2::new(30.0, -60.0));
        assert_eq!((area.cols, area.rows, area.crs.epsg()), (2, 3, Some(32631)));
        assert_eq!(area.bands[0], [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
        assert_eq!(placed(2).origin, DVec2::new(400_000.0, 4_700_060.0));
    }

    #[test]
    fn matrices_may_be_south_up_but_not_rotated() {
        let placed = |b: f64, e: f64| {
            let mut matrix = [0.0; 16];
            (matrix[0], matrix[1], matrix[3]) = (10.0, b, 500.0);
            (matrix[4], matrix[5], matrix[7]) = (b, e, 900.0);
            int16(&[1, 2, 3, 4]).doubles(tag::MODEL_TRANSFORMATION, &matrix)
        };
        let raster = placed(0.0, 10.0).read().unwrap();
        assert_eq!((raster.origin, raster.step), (DVec2::new(505.0, 905.0), DVec2::splat(10.0)));
        assert!(placed(1.0, -10.0).refusal().contains("north-up"));
        assert!(placed(0.0, 0.0).refusal().contains("cell size"));
    }

    #[test]
    fn nodata_scale_and_unit_are_applied_in_this_order() {
        let item = |role: &str, value: &str| {
            format!("<Item name=\"X\" sample=\"0\" role=\"{role}\">{value}</Item>")
        };
        let metadata = item("scale", "0.5") + &item("offset", "100") + &item("unittype", "ft");
        let writer =
            int16(&[-1, 10]).text(tag::GDAL_NODATA, "-1.0").text(tag::GDAL_METADATA, &metadata);
        let raster = writer.read().unwrap();
        assert!(raster.bands[0][0].is_nan());
        assert_eq!(raster.bands[0][1], 105.0);
        assert_eq!(raster.source.metres_per_height_unit, 0.3048);
        assert_eq!(raster.source.nodata.as_deref(), Some("-1.0"));
        let writer = int16(&[1, 2]).text(tag::GDAL_METADATA, &item("unittype", "smoot"));
        assert!(writer.refusal().contains("smoot"));
    }

    #[test]
    fn nodata_is_compared_as_the_samples_are_stored() {
        let data: Vec<u8> = [f32::MIN, 0.1, f32::INFINITY, f32::NAN, 1.0, 2.0]
            .iter()
            .flat_map(|v| v.to_le_bytes())
            .collect();
        let voids = |nodata: &str| {
            let writer = Writer::new(2, 32, 3, &data).text(tag::GDAL_NODATA, nodata);
            writer.read().unwrap().bands[0].iter().map(|v| v.is_nan()).collect::<Vec<_>>()
        };
        assert_eq!(voids("-3.40282346638529e+38"), [true, false, true, true, false, false]);
        assert_eq!(voids("0.1"), [false, true, true, true, false, false]);
        assert_eq!(voids("nan"), [false, false, true, true, false, false]);
    }

    #[test]
    fn undeclared_voids_are_noted_and_kept() {
        let raster = int16(&[-32768, 5]).read().unwrap();
        assert_eq!(raster.bands[0], [-32768.0, 5.0]);
        assert!(raster.notes.iter().any(|n| n.contains("-32768")));
    }

    #[test]
    fn an_alpha_band_is_a_mask() {
        // Two bands, cell by cell: heights 5, 6, 7, 8, and how opaque.
        let samples = |extra: u16| {
            let data: Vec<u8> =
                [5u16, 0, 6, 255, 7, 1, 8, 0].iter().flat_map(|v| v.to_le_bytes()).collect();
            let writer = Writer::new(2, 32, 1, &data).shorts(tag::BITS_PER_SAMPLE, &[16, 16]);
            let writer = writer.shorts(tag::SAMPLES_PER_PIXEL, &[2]);
            writer.shorts(tag::EXTRA_SAMPLES, &[extra])
        };
        let voids = |writer: Writer| {
            writer.read().unwrap().bands[0].iter().map(|v| v.is_nan()).collect::<Vec<_>>()
        };
        assert_eq!(voids(samples(2)), [true, false, false, true]);
        assert_eq!(voids(samples(0)), [false; 4]);
        // As GDAL has it, a nodata value that is declared goes before.
        assert_eq!(voids(samples(2).text(tag::GDAL_NODATA, "6")), [false, true, false, false]);
    }

    #[test]
    fn bits_may_be_stored_in_reverse() {
        let data: Vec<u8> = [300u16, 1, 2, 3].iter().flat_map(|v| v.to_le_bytes()).collect();
        let reversed: Vec<u8> = data.iter().map(|byte| byte.reverse_bits()).collect();
        let raster = Writer::new(2, 16, 1, &reversed).shorts(tag::FILL_ORDER, &[2]).read().unwrap();
        assert_eq!(raster.bands[0], [300.0, 1.0, 2.0, 3.0]);
    }

    #[test]
    fn absent_blocks_are_nodata_or_zero() {
        let absent = || int16(&[1, 2, 3, 4]).shorts(tag::STRIP_BYTE_COUNTS, &[0]);
        assert_eq!(absent().read().unwrap().bands[0], [0.0; 4]);
        let raster = absent().text(tag::GDAL_NODATA, "-1").read().unwrap();
        assert!(raster.bands[0].iter().all(|v| v.is_nan()));
    }

    #[test]
    fn files_beside_say_what_is_void_and_in_which_unit() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("dem.tif");
        fs::write(&path, int16(&[1, 2, 3, 4]).text(tag::GDAL_NODATA, "1").bytes()).unwrap();
        let heights =
            |unit| crate::terrain::Terrain::open_in(&path, unit).unwrap().heights().to_vec();
        assert_eq!(heights(None)[1..], [2.0, 3.0, 4.0]);
        assert_eq!(heights(Some(HeightUnit::Foot))[3], 4.0 * 0.3048);
        let band = "<PAMRasterBand band=\"1\"><NoDataValue>3</NoDataValue><UnitType>ft</UnitType></PAMRasterBand>";
        fs::write(folder.path().join("dem.tif.aux.xml"), band).unwrap();
        assert!(heights(None)[2].is_nan() && heights(None)[0] == 0.3048);
        assert_eq!(heights(Some(HeightUnit::Metre))[3], 4.0);
        let mask = Writer::new(2, 8, 1, &[255, 255, 255, 0]);
        fs::write(folder.path().join("dem.tif.msk"), mask.bytes()).unwrap();
        let voids: Vec<bool> = heights(None).iter().map(|v| v.is_nan()).collect();
        assert_eq!(voids, [false, false, true, true]);
    }

    #[test]
    fn pictures_and_unknown_units_are_refused() {
        assert!(
            Writer::new(2, 8, 1, &[0; 4]).shorts(tag::COMPRESSION, &[7]).refusal().contains("JPEG")
        );
        assert!(Writer::new(8, 1, 1, &[0; 4]).refusal().contains("one bit"));
        assert!(Writer::new(1, 64, 6, &[0; 8]).refusal().contains("complex"));
        let keys = [1, 1, 0, 3, 1024, 0, 1, 1, 3072, 0, 1, 32767, 3076, 0, 1, 9300];
        assert!(int16(&[1, 2]).shorts(tag::GEO_KEY_DIRECTORY, &keys).refusal().contains("unit"));
    }

    #[test]
    fn a_world_file_places_the_grid() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("dem.tif");
        fs::write(&path, int16(&[1, 2, 3, 4]).bytes()).unwrap();
        let terrain = crate::terrain::Terrain::open(&path).unwrap();
        assert_eq!(terrain.frame().step(), DVec2::ONE);
        assert_eq!(terrain.frame().origin(), DVec2::new(0.5, 1.5));
        assert!(terrain.notes().iter().any(|n| n.contains("no place")));
        fs::write(path.with_extension("tfw"), "5\n0\n0\n-5\n1002.5\n2002.5\n").unwrap();
        let terrain = crate::terrain::Terrain::open(&path).unwrap();
        assert_eq!(terrain.frame().origin(), DVec2::new(1002.5, 2002.5));
        assert_eq!(terrain.frame().step(), DVec2::splat(5.0));
        assert_eq!(terrain.heights(), [1.0, 2.0, 3.0, 4.0]);
        fs::write(path.with_extension("tfw"), "5\n1\n1\n-5\n1002.5\n2002.5\n").unwrap();
        assert!(crate::terrain::Terrain::open(&path).unwrap_err().to_string().contains("north-up"));
    }

    #[test]
    fn degrees_without_a_crs_are_taken_for_degrees() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("dem.asc");
        let header =
            "ncols 2\nnrows 2\nxllcorner -118.2\nyllcorner 34.6\ncellsize 0.0008333\n1 2 3 4";
        fs::write(&path, header).unwrap();
        let terrain = crate::terrain::Terrain::open(&path).unwrap();
        assert_eq!(terrain.crs().epsg(), Some(4326));
        assert!(terrain.notes().iter().any(|n| n.contains("degrees")));
    }
}
