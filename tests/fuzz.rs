//! Files that are damaged, hostile or of another kind are read or refused: no panic, no hang, no flood of memory.
//!
//! `fuzz/corpus` holds small files of each target: sound ones to begin with, and those with which something was once wrong. One test reads
//! them all; the other mutates them, as often as it is told to. docs/fuzzing.md has the command and what has been run.

use std::collections::HashSet;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};
use std::{env, fs};

use glam::DVec2;
use ridgeway::metric::Metric;
use ridgeway::plan::read_geojson;
use ridgeway::route::trace;
use ridgeway::terrain::{Georeference, read_bands};
use ridgeway::{
    Control, Crs, Curvature, Error, FitOptions, GridFrame, HeightSurface, Isotropic, Modifiers,
    NurbsSurface, Result, Solver, Stop, Terrain,
};

/// Something that reads files.
struct Target {
    /// Its folder in the corpus.
    name: &'static str,
    /// The name that the file has when it is read.
    file: &'static str,
    /// Reads the file and tries what was read; what was notable, in words.
    read: fn(&Path) -> Result<String>,
}

const TARGETS: [Target; 9] = [
    Target { name: "tiff", file: "dem.tif", read: open },
    Target { name: "bands", file: "cost.tif", read: bands },
    Target { name: "ascii_grid", file: "dem.asc", read: open },
    Target { name: "plan", file: "dem.asc", read: plan },
    Target { name: "hgt", file: "N42E001.hgt.zip", read: open },
    Target { name: "nurbs", file: "surface.json", read: nurbs },
    Target { name: "geojson", file: "wall.geojson", read: geojson },
    Target { name: "wkt", file: "dem.prj", read: wkt },
    Target { name: "aux_xml", file: "dem.tif.aux.xml", read: aux_xml },
];

/// Opens a DEM and takes its corners to longitude and latitude and back.
fn open(path: &Path) -> Result<String> {
    let terrain = Terrain::open(path)?;
    let frame = terrain.frame();
    let last = DVec2::new((frame.cols() - 1) as f64, (frame.rows() - 1) as f64);
    for corner in [DVec2::ZERO, last, -last, last * 1e6] {
        // Without a CRS there is no way.
        let _ = terrain.to_lonlat(corner).and_then(|lonlat| terrain.from_lonlat(lonlat));
    }
    Ok(format!("{:?} {}", terrain.notes(), terrain.crs().unit()))
}

fn bands(path: &Path) -> Result<String> {
    let raster = read_bands(path)?;
    Ok(if raster.bands.len() > 1 { "bands" } else { "a band" }.into())
}

fn nurbs(path: &Path) -> Result<String> {
    Ok(format!("{:?}", NurbsSurface::open(path)?.closed()))
}

/// Goes the whole way from a DEM to routes.
fn plan(path: &Path) -> Result<String> {
    /// Larger grids are left to other tests.
    const MOST: usize = 4096;
    let (terrain, control) = (Terrain::open(path)?, Control::default());
    let frame = terrain.frame();
    if frame.nodes() > MOST {
        return Ok("large".into());
    }
    let surface = HeightSurface::fit(&terrain, &FitOptions::default(), &control)?;
    let goal = DVec2::new((frame.cols() - 1) as f64, (frame.rows() - 1) as f64);
    let metrics: [&dyn Metric; 2] = [&Isotropic, &Curvature::default()];
    for metric in metrics {
        let field = metric.on(&surface, &Modifiers::default(), &control)?;
        let start = [DVec2::ZERO.into()];
        let distance = Solver::default().solve(&field, &start, &Stop::Never, &control)?;
        trace(&distance, &field, goal)?;
    }
    Ok(format!("{:?}", terrain.notes()))
}

/// Reads geometry over a small grid in Andorra.
fn geojson(path: &Path) -> Result<String> {
    let crs = Crs::from_epsg(32631)?;
    let frame =
        GridFrame::new(50, 40, DVec2::new(387e3, 4712e3), DVec2::splat(75.0), crs.ground())?;
    let shapes = read_geojson(path, &Georeference::new(frame, crs))?;
    let are_there = [shapes.points.is_empty(), shapes.lines.is_empty(), shapes.polygons.is_empty()];
    Ok(format!("{are_there:?}"))
}

/// Opens a small grid beside which the `.prj` lies.
fn wkt(path: &Path) -> Result<String> {
    let grid = path.with_extension("asc");
    if !grid.exists() {
        let header = "ncols 2\nnrows 2\nxllcorner 500000\nyllcorner 4700000\ncellsize 10\n";
        fs::write(&grid, format!("{header}1 2\n3 4\n")).unwrap();
    }
    open(&grid)
}

/// Opens a small GeoTIFF next to which the `.aux.xml` lies.
fn aux_xml(path: &Path) -> Result<String> {
    let grid = path.with_file_name("dem.tif");
    if !grid.exists() {
        fs::write(&grid, include_bytes!("../fuzz/corpus/tiff/plain.tif")).unwrap();
    }
    open(&grid)
}

impl Target {
    fn corpus(&self) -> Vec<Vec<u8>> {
        let mut files: Vec<PathBuf> =
            fs::read_dir(self.folder()).unwrap().map(|entry| entry.unwrap().path()).collect();
        files.sort();
        assert!(!files.is_empty(), "no corpus for {}", self.name);
        files.iter().map(|file| fs::read(file).unwrap()).collect()
    }

    fn folder(&self) -> PathBuf {
        Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz/corpus").join(self.name)
    }

    /// Reads `bytes` as a file in `folder`.
    ///
    /// # Panics
    /// If the reader does, or takes too long; then the file is kept in the corpus.
    fn run(&self, folder: &Path, bytes: &[u8]) -> Result<String> {
        const LONGEST: Duration = Duration::from_secs(5);
        let path = folder.join(self.file);
        fs::write(&path, bytes).unwrap();
        let begun = Instant::now();
        let outcome = catch_unwind(AssertUnwindSafe(|| (self.read)(&path)));
        let took = begun.elapsed();
        match outcome {
            Ok(outcome) if took < LONGEST => outcome,
            _ => {
                let found = self.folder().join(format!("found-{:016x}", hash(bytes)));
                fs::write(&found, bytes).unwrap();
                panic!("{}: panicked, or took {took:?}", found.display());
            }
        }
    }
}

/// What became of a file, without the words and numbers that are the file's own.
fn kind(outcome: &Result<String>) -> String {
    let words = match outcome {
        Ok(words) => words.clone(),
        Err(Error::Argument(mismatch) | Error::Format { mismatch, .. }) => {
            format!("{} {:?}", mismatch.what, mismatch.expected)
        }
        Err(Error::Unsupported { advice, .. }) => advice.to_string(),
        Err(_) => "another error".into(),
    };
    let own = words.split('`').step_by(2).collect::<String>();
    own.replace(|c: char| !c.is_ascii_alphabetic(), "")
}

fn hash(value: &(impl Hash + ?Sized)) -> u64 {
    let mut hasher = DefaultHasher::new();
    value.hash(&mut hasher);
    hasher.finish()
}

/// SplitMix64 (Steele, Lea and Flood 2014).
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// A number below `end`, which is not 0.
    fn below(&mut self, end: usize) -> usize {
        (self.next() % end as u64) as usize
    }

    fn pick<'a, T: ?Sized>(&mut self, of: &[&'a T]) -> &'a T {
        of[self.below(of.len())]
    }
}

/// Numbers at which readers stumble, as text.
const NUMBERS: [&str; 14] = [
    "0",
    "-1",
    "1e308",
    "-1e308",
    "1e-308",
    "nan",
    "inf",
    "4294967296",
    "65535",
    "2147483647",
    "18446744073709551615",
    "0.5",
    "90",
    "1e999",
];

/// Longest file that mutation makes.
const LONGEST: usize = 1 << 16;

/// Changes a file in one to four places, with pieces of another one.
fn mutate(bytes: &mut Vec<u8>, other: &[u8], random: &mut Random) {
    for _ in 0..=random.below(4) {
        if bytes.is_empty() {
            bytes.extend(other);
            continue;
        }
        let at = random.below(bytes.len());
        let end = at + random.below((bytes.len() - at).min(64)) + 1;
        match random.below(9) {
            0 => bytes[at] ^= 1 << random.below(8),
            1 => bytes[at] = random.next() as u8,
            2 => bytes[at] = bytes[at].wrapping_add(*random.pick(&[&1, &255, &16, &240])),
            3 => drop(bytes.drain(at..end)),
            4 => bytes.truncate(at),
            5 => {
                let piece = bytes[at..end].repeat(random.below(4) + 1);
                bytes.splice(at..at, piece);
            }
            6 => {
                let from = random.below(other.len().max(1)).min(other.len());
                let to = other.len().min(from + random.below(64) + 1);
                let over = end.min(at + (to - from));
                bytes.splice(at..over, other[from..to].iter().copied());
            }
            7 => {
                // Powers of two and their neighbours, in either order of bytes.
                let value = (1u64 << random.below(64)).wrapping_sub(random.below(3) as u64);
                let width = *random.pick(&[&1, &2, &4, &8]);
                let mut value = value.to_le_bytes()[..width].to_vec();
                if random.below(2) == 0 {
                    value.reverse();
                }
                let over = bytes.len().min(at + width);
                bytes.splice(at..over, value);
            }
            _ => {
                // A number in text is replaced, else one is put in.
                let is_part = |b: &u8| b.is_ascii_digit() || b"+-.e".contains(b);
                let length = bytes[at..].iter().take_while(|b| is_part(b)).count();
                bytes.splice(at..at + length, random.pick(&NUMBERS).bytes());
            }
        }
        bytes.truncate(LONGEST);
    }
}

#[test]
fn the_corpus_is_read_or_refused() {
    for target in &TARGETS {
        let folder = tempfile::tempdir().unwrap();
        for bytes in target.corpus() {
            let _ = target.run(folder.path(), &bytes);
        }
    }
}

/// `FUZZ_EXECUTIONS` for each target, or the one of `FUZZ_TARGET`, from the seed `FUZZ_SEED`. A file with an outcome
/// of a new kind joins those that are mutated.
#[test]
fn mutated_files_are_read_or_refused() {
    const POOL: usize = 2000;
    let (executions, seed) = (number("FUZZ_EXECUTIONS", 1000), number("FUZZ_SEED", 1));
    let only = env::var("FUZZ_TARGET").ok();
    for target in TARGETS.iter().filter(|target| only.as_deref().is_none_or(|t| t == target.name)) {
        let folder = tempfile::tempdir().unwrap();
        let (sound, mut pool, mut kinds) = (target.corpus(), target.corpus(), HashSet::new());
        let (mut random, mut read, begun) = (Random(seed), 0, Instant::now());
        for _ in 0..executions {
            let from = if random.below(2) == 0 { &sound } else { &pool };
            let mut bytes = from[random.below(from.len())].clone();
            mutate(&mut bytes, &pool[random.below(pool.len())], &mut random);
            let outcome = target.run(folder.path(), &bytes);
            read += u64::from(outcome.is_ok());
            if kinds.insert(kind(&outcome)) && pool.len() < POOL {
                pool.push(bytes);
            }
        }
        let seconds = begun.elapsed().as_secs_f64();
        println!(
            "{}: {executions} files from seed {seed}, {read} read, {} kinds of outcomes, {seconds:.0} s, {:.0} a second",
            target.name,
            kinds.len(),
            executions as f64 / seconds
        );
    }
}

/// The number of an environment variable.
fn number(name: &str, default: u64) -> u64 {
    env::var(name).map_or(default, |text| text.parse().unwrap())
}
