//! The `ridgeway` command as its users meet it: right uses, wrong uses, exit codes and files.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use assert_cmd::cargo::cargo_bin;
use serde_json::Value;
use tempfile::TempDir;

/// A folder with inputs, in which commands run.
struct Folder(TempDir);

/// What a command did.
#[derive(Debug)]
struct Outcome {
    code: i32,
    out: String,
    err: String,
}

impl Folder {
    /// Holds `range.tif` (61 × 41 cells of 30 m in UTM 32N from 500000,5000000), `plain.tif` (no CRS),
    /// `split.asc` (two halves with a column of voids between) and a wall that splits `range.tif`.
    fn new() -> Self {
        let folder = Self(TempDir::new().unwrap());
        folder
            .good("synth range --size 61x41 --crs EPSG:32632 --origin 500000,5000000 -o range.tif");
        folder.good("synth bumps --size 41x31 -o plain.tif");
        folder.write(
            "split.asc",
            "ncols 5\nnrows 3\nxllcorner 0\nyllcorner 0\ncellsize 10\nNODATA_value -9999\n\
             1 1 -9999 1 1\n1 1 -9999 2 1\n1 1 -9999 1 1\n",
        );
        folder
            .write("wall.geojson", r#"{"type":"LineString","coordinates":[[9.01,44],[9.01,46]]}"#);
        folder.write(
            "huts.geojson",
            r#"{"type":"MultiPoint","coordinates":[[9.002,45.155],[9.02,45.16]]}"#,
        );
        folder
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn write(&self, name: &str, content: &str) {
        fs::write(self.path(name), content).unwrap();
    }

    fn read(&self, name: &str) -> String {
        fs::read_to_string(self.path(name)).unwrap()
    }

    fn json(&self, name: &str) -> Value {
        serde_json::from_str(&self.read(name)).unwrap()
    }

    /// Runs a command line, split at blanks.
    fn run(&self, line: &str) -> Outcome {
        let output = Command::new(cargo_bin!("ridgeway"))
            .args(line.split_whitespace())
            .current_dir(self.0.path())
            .output()
            .unwrap();
        Outcome {
            code: output.status.code().unwrap(),
            out: String::from_utf8(output.stdout).unwrap(),
            err: String::from_utf8(output.stderr).unwrap(),
        }
    }

    /// Runs a command line that must do well.
    fn good(&self, line: &str) -> String {
        let outcome = self.run(line);
        assert_eq!(outcome.code, 0, "{line}: {outcome:?}");
        outcome.out
    }

    /// Runs a command line that must fail with this code and message, and write nothing.
    fn bad(&self, line: &str, code: i32, message: &str) {
        let before = self.files();
        let outcome = self.run(line);
        let lines = outcome.err.lines().filter(|line| !line.starts_with("note: "));
        let said = lines.take_while(|line| !line.is_empty()).collect::<Vec<_>>().join("\n");
        assert_eq!(said, format!("error: {message}"), "{line}");
        assert_eq!(outcome.code, code, "{line}: {}", outcome.err);
        assert_eq!(outcome.out, "", "{line}");
        assert_eq!(self.files(), before, "{line}");
    }

    fn files(&self) -> Vec<PathBuf> {
        let mut files: Vec<_> =
            fs::read_dir(self.0.path()).unwrap().map(|entry| entry.unwrap().path()).collect();
        files.sort();
        files
    }
}

fn is_tiff(path: &Path) -> bool {
    fs::read(path).unwrap().starts_with(b"II")
}

fn is_png(path: &Path) -> bool {
    fs::read(path).unwrap().starts_with(b"\x89PNG")
}

#[test]
fn info_tells_people_and_machines() {
    let folder = Folder::new();
    let text = folder.good("info range.tif");
    assert!(text.contains("size       61 columns x 41 rows\n"), "{text}");
    assert!(text.contains("CRS        EPSG:32632"), "{text}");
    let json: Value = serde_json::from_str(&folder.good("info split.asc --json -q")).unwrap();
    assert_eq!(json["columns"], 5);
    assert_eq!(json["rows"], 3);
    assert_eq!(json["void_count"], 3);
    assert_eq!(json["min_height_m"], 1.0);
    assert_eq!(json["max_height_m"], 2.0);
    assert_eq!(json["cell_size"], serde_json::json!([10.0, 10.0]));
    assert_eq!(json["extent"], serde_json::json!([0.0, 0.0, 50.0, 30.0]));
    assert_eq!(json["unit"], "metre");
    assert_eq!(json["crs"]["epsg"], Value::Null);
}

#[test]
fn a_crs_that_is_only_a_name_is_told() {
    let folder = Folder::new();
    let rows = "0 1 2 3 4 5\n".repeat(5);
    folder.write(
        "x.asc",
        &format!("ncols 6\nnrows 5\nxllcorner 0\nyllcorner 0\ncellsize 30\n{rows}"),
    );
    folder.write("x.prj", r#"PROJCS["Our grid",UNIT["metre",1]]"#);
    let told = folder.run("route x.asc --start pixel:1,1 --goal pixel:4,3 -o x.geojson");
    assert!(
        told.err.contains("note: of the CRS Our grid no more is known than its name"),
        "{told:?}"
    );
    assert!(told.out.contains("wrote x.geojson in map coordinates"), "{told:?}");
}

#[test]
fn a_dem_around_the_earth_has_no_edge() {
    let folder = Folder::new();
    let rows = format!("{}\n", "0 ".repeat(72)).repeat(9);
    let header = "ncols 72\nnrows 9\nxllcorner -180\nyllcorner -22.5\ncellsize 5\n";
    folder.write("globe.asc", &format!("{header}{rows}"));
    folder.write("globe.prj", "+proj=longlat +datum=WGS84");
    let places = "--start lonlat:175,0 --goal lonlat:-175,0 --goal lonlat:185,0";
    let told = folder.run(&format!("distance globe.asc --metric isotropic {places}"));
    // A degree along the equator measures 111.32 km.
    assert_eq!(told.out.matches("1113.19 km").count(), 2, "{told:?}");
    let told = folder.run(
        "route globe.asc --metric isotropic --start lonlat:175,0 --goal lonlat:-175,0 -o r.geojson",
    );
    assert!(told.err.is_empty(), "{told:?}");
    assert!(folder.read("r.geojson").contains("MultiLineString"));
}

#[test]
fn maps_that_stretch_the_ground_are_told() {
    let folder = Folder::new();
    // Mercator maps double lengths at 60°; those of the web are corrected.
    folder.write(
        "x.asc",
        "ncols 2\nnrows 2\nxllcorner 500000\nyllcorner 8370000\ncellsize 30\n1 1\n1 2\n",
    );
    for (code, cell, note) in [
        (3395, "30 x 30 m", "note: a metre of this map is 0.501 to 0.501 m on the ground"),
        (3857, "30 x 30 metre (15.", ""),
        (32632, "30 x 30 m", ""),
    ] {
        let prj = format!(r#"PROJCS["x",UNIT["metre",1],AUTHORITY["EPSG","{code}"]]"#);
        folder.write("x.prj", &prj);
        let told = folder.run("info x.asc");
        assert!(told.out.contains(&format!("cell       {cell}")), "{code}: {told:?}");
        assert!(told.err.starts_with(note) && told.err.is_empty() == note.is_empty(), "{told:?}");
    }
}

#[test]
fn info_announces_the_surface_that_is_fitted() {
    let folder = Folder::new();
    folder.write(
        "wide.asc",
        "ncols 3\nnrows 2\nxllcorner 0\nyllcorner 0\ndx 20\ndy 45\n1 2 3 4 5 6\n",
    );
    let length = |command: &str| {
        let text = folder.good(command);
        let line = text.lines().find(|line| line.starts_with("surface")).unwrap();
        line.rsplit_once(' ').unwrap().0.rsplit_once(' ').unwrap().1.to_owned()
    };
    assert_eq!(length("info wide.asc"), length("surface wide.asc"));
}

#[test]
fn synth_lists_its_kinds_and_repeats_itself() {
    let folder = Folder::new();
    let list = folder.good("synth --list");
    for kind in ["plane", "cylinder", "sphere", "cone", "bumps", "four-bumps", "range", "fractal"] {
        assert!(list.lines().any(|line| line.starts_with(kind)), "{kind}");
    }
    folder.good("synth fractal --size 33x29 --seed 3 -o a.tif");
    folder.good("synth fractal --size 33x29 --seed 3 -o b.tif --threads 1");
    assert_eq!(fs::read(folder.path("a.tif")).unwrap(), fs::read(folder.path("b.tif")).unwrap());
}

#[test]
fn surface_reports_residuals_and_writes_layers() {
    let folder = Folder::new();
    let line =
        "surface range.tif --layers height,slope,gaussian,mean,k1,k2 -o s.tif --smooth 0 --json";
    let json: Value = serde_json::from_str(&folder.good(line)).unwrap();
    assert!(json["rms_residual_m"].as_f64().unwrap() < 1e-6, "{json}");
    assert!(is_tiff(&folder.path("s.tif")));
    let text = folder.good("surface range.tif --degree quintic --smooth 8cells");
    assert!(text.contains("quintic B-spline, cut-off 240 m"), "{text}");
}

#[test]
fn distance_writes_rasters_isolines_and_statistics() {
    let folder = Folder::new();
    let text = folder.good(
        "distance range.tif --start pixel:5,5 --goal pixel:50,30 --metric isotropic \
         -o d.tif --direction --isolines i.geojson --step 250 --stats",
    );
    assert!(text.contains(" 2501 of 2501 cells\n"), "{text}");
    assert!(text.contains("median"), "{text}");
    assert!(is_tiff(&folder.path("d.tif")));
    let isolines = folder.json("i.geojson");
    assert_eq!(isolines["features"][1]["properties"]["distance"], 500.0);
    assert_eq!(isolines["features"][1]["properties"]["unit"], "m");
    let info: Value = serde_json::from_str(&folder.good("info d.tif --json -q")).unwrap();
    assert_eq!(info["min_height_m"], 0.0);
}

#[test]
fn high_accuracy_estimates_its_error() {
    let folder = Folder::new();
    let line = "distance range.tif --start pixel:5,5 --metric isotropic -o d.tif --error --stats";
    let text = folder.good(&format!("{line} --accuracy high"));
    for part in ["mean estimated error", " sweeps per node, ", "37 bytes per node"] {
        assert!(text.contains(part), "{part}: {text}");
    }
    assert!(is_tiff(&folder.path("d.tif")));
    folder.bad(line, 2, "--error needs --accuracy high: only then the error is estimated");
}

#[test]
fn labels_tell_the_starts_apart_and_a_largest_distance_ends_the_map() {
    let folder = Folder::new();
    let line = "distance range.tif --start pixel:5,20 --start pixel:55,20 --metric isotropic";
    folder.good(&format!("{line} --labels l.tif -o d.tif --max-distance 600"));
    let info = |file| -> Value {
        serde_json::from_str(&folder.good(&format!("info {file} --json -q"))).unwrap()
    };
    let (labels, distance) = (info("l.tif"), info("d.tif"));
    assert_eq!((&labels["min_height_m"], &labels["max_height_m"]), (&1.0.into(), &2.0.into()));
    assert!(distance["max_height_m"].as_f64().unwrap() <= 600.0);
    assert_eq!(labels["void_count"], distance["void_count"]);
    assert!(labels["void_count"].as_u64().unwrap() > 500);
    let negative = "invalid value '-1' for '--max-distance <VALUE>': expected a number, 0 or more";
    folder.bad(&format!("{line} --max-distance -1"), 2, negative);
}

#[test]
fn routes_end_where_they_were_asked_to() {
    let folder = Folder::new();
    let line = "route range.tif --start 500150,5000150 --start pixel:60,0 --goal huts.geojson \
                -o r.geojson -o r.gpx -o r.csv --json";
    let json: Value = serde_json::from_str(&folder.good(line)).unwrap();
    assert_eq!(json["routes"].as_array().unwrap().len(), 2);
    assert_eq!(json["routes"][0]["summary"]["cost_unit"], "AG units");
    let geojson = folder.json("r.geojson");
    let way = geojson["features"][0]["geometry"]["coordinates"].as_array().unwrap();
    let end = way.last().unwrap();
    assert!((end[0].as_f64().unwrap() - 9.002).abs() < 1e-6, "{end}");
    assert!((end[1].as_f64().unwrap() - 45.155).abs() < 1e-6, "{end}");
    assert_eq!(geojson["provenance"]["dem"], "range.tif");
    assert_eq!(geojson["provenance"]["start"][1], "pixel:60,0");
    assert!(
        geojson["provenance"]["command"].as_str().unwrap().starts_with("ridgeway route range.tif")
    );
    assert!(geojson["provenance"]["metrics"][0]["delta_per_m"].as_f64().unwrap() > 0.0);
    assert!(folder.read("r.gpx").contains("<trk>"));
    assert!(folder.read("r.csv").starts_with("route,distance_m,x,y,height_m"));
}

#[test]
fn notations_of_one_place_give_one_route() {
    let folder = Folder::new();
    let route = |start: &str| {
        let line = format!("route range.tif --start {start} --goal pixel:50,30 --json");
        let json: Value = serde_json::from_str(&folder.good(&line)).unwrap();
        json["routes"][0]["summary"]["cost"].as_f64().unwrap()
    };
    let cost = route("500300,5000900");
    assert_eq!(route("pixel:10,10"), cost);
    // UTM 32N of longitude 9°, the zone's middle, is x = 500000.
    let near = route("lonlat:9.003815,45.161577");
    assert!((near - cost).abs() < 1e-3 * cost, "{near} {cost}");
}

#[test]
fn a_tensor_raster_measures_as_its_tensor_says() {
    let folder = Folder::new();
    folder.good("synth plane --size 41x31 --relief 100 -o plane.tif");
    // Bands c, 0, c: the unit tensor times the slope in degrees.
    folder.good("surface plane.tif --layers slope,gaussian,slope -o tensor.tif");
    let distance = |more: &str| {
        let line =
            format!("distance plane.tif --start pixel:5,5 --goal pixel:35,5 --json -q {more}");
        let json: Value = serde_json::from_str(&folder.good(&line)).unwrap();
        json["goals"][0]["distance"].as_f64().unwrap()
    };
    // The plane climbs h/2a = 100/1200 over its longer half-axes.
    let slope = (100.0f64 / 1200.0).atan().to_degrees();
    let expected = 900.0 / slope.sqrt();
    let found = distance("--tensor tensor.tif");
    assert!((found - expected).abs() < 1e-3 * expected, "{found} {expected}");
    for command in [
        "distance plane.tif --start pixel:5,5 --metric curvature",
        "compare plane.tif --start pixel:5,5 --goal pixel:9,9 --metrics isotropic,curvature",
    ] {
        let unused = "--tensor is used by the metric `tensor` alone, which is not asked for; name it, or leave --tensor out";
        folder.bad(&format!("{command} --tensor tensor.tif"), 2, unused);
    }
    // As a cost the slope multiplies every length; along its row the plane rises 1 : 12.
    folder.good("surface plane.tif --layers slope -o cost.tif");
    let ratio = distance("--cost cost.tif --metric isotropic") / distance("--metric isotropic");
    assert!((ratio / slope - 1.0).abs() < 1e-4, "{ratio} {slope}");
    let line = "distance plane.tif --start pixel:5,5 --cost";
    folder.bad(
        &format!("{line} tensor.tif"),
        2,
        "tensor.tif: the number of bands is 3; it must be 1 for costs",
    );
    let cells = "1 ".repeat(41 * 31 - 1);
    folder.write(
        "far.asc",
        &format!("ncols 41\nnrows 31\nxllcorner -15\nyllcorner -15\ncellsize 30\n{cells}9999\n"),
    );
    folder.bad(
        &format!("{line} far.asc"),
        2,
        "the range of the costs is 1 to 9999; it must be as wide as 1 to 1000 at most; mark barriers by NaN or nodata",
    );
}

#[test]
fn compare_fills_a_folder_and_repeats_itself() {
    let folder = Folder::new();
    let line = "compare range.tif --start pixel:5,5 --goal pixel:50,30 -o cmp";
    let table = folder.good(line);
    let head = table.lines().next().unwrap();
    for column in [
        "route",
        "length",
        "climb",
        "DEM climb",
        "max grade",
        "mean grade",
        "∫|κn|ds",
        "x isotropic",
        "x curvature",
        "x difference",
    ] {
        assert!(head.contains(column), "{head}");
    }
    let summary = folder.json("cmp/summary.json");
    for (r, metric) in ["isotropic", "curvature", "difference"].into_iter().enumerate() {
        assert_eq!(summary["routes"][r]["name"], metric);
        assert_eq!(summary["routes"][r]["costs"][metric]["ratio_to_best"], 1.0);
        // On ground as even as this, the DEM climbs about as much as the surface that is fitted to it.
        let of = |heights: &str| summary["routes"][r][heights]["climb_m"].as_f64().unwrap();
        let ratio = of("on_dem") / of("summary");
        assert!((ratio - 1.0).abs() < 0.05 && ratio != 1.0, "{ratio}");
    }
    assert!(is_png(&folder.path("cmp/map.png")));
    assert_eq!(folder.json("cmp/routes.geojson")["features"].as_array().unwrap().len(), 3);
    let profile = folder.read("cmp/profile.csv");
    assert!(profile.contains("\nisotropic,") && profile.contains(",dem_height_m\n"), "{profile}");
    folder.write("cmp/mine.txt", "keep");
    folder.bad(line, 2, "cmp/routes.geojson: exists; give --overwrite to replace it");
    let again = folder.good(&format!("{line} --overwrite --threads 1"));
    assert_eq!(table, again);
    assert_eq!(folder.read("cmp/mine.txt"), "keep");
}

#[test]
fn on_a_plane_the_curvature_route_is_straight() {
    // Its heights are rounded to four bytes, which bends it a little.
    let folder = Folder::new();
    folder.good("synth plane --size 201x151 --spacing 10 -o plane.tif");
    let places = "plane.tif --start pixel:10,10 --goal pixel:180,120";
    let told = folder.good(&format!("compare {places} --metrics isotropic,curvature --json -q"));
    let json: Value = serde_json::from_str(&told).unwrap();
    let ratio = json["routes"][1]["costs"]["isotropic"]["ratio_to_best"].as_f64().unwrap();
    assert!(ratio < 1.0 + 1e-6, "{ratio}");
}

#[test]
fn render_draws_every_layer_and_routes() {
    let folder = Folder::new();
    for layer in ["hillshade", "height", "slope", "mean", "gaussian"] {
        folder.good(&format!("render range.tif --layer {layer} --width 200 -o {layer}.png"));
        assert!(is_png(&folder.path(&format!("{layer}.png"))));
    }
    folder.good("render range.tif --start pixel:5,5 --goal pixel:50,30 --width 200 -o route.png");
    assert!(is_png(&folder.path("route.png")));
}

#[test]
fn quiet_is_silent_and_scripts_are_printed() {
    let folder = Folder::new();
    let outcome = folder.run("route plain.tif --start pixel:5,5 --goal pixel:30,20 -q");
    assert_eq!((outcome.code, outcome.out.as_str(), outcome.err.as_str()), (0, "", ""));
    assert!(folder.good("completions bash").contains("ridgeway"));
    let manual = folder.good("man");
    assert!(manual.contains(".TH ridgeway 1") && manual.contains(".TH ridgeway-route 1"));
    assert!(folder.good("--version").starts_with("ridgeway "));
}

#[test]
fn progress_is_told_when_asked_for() {
    let folder = Folder::new();
    let outcome = folder.run("route range.tif --start pixel:5,5 --goal pixel:30,20 --progress");
    assert!(outcome.err.contains("solving distance"), "{outcome:?}");
}

#[test]
fn a_reader_that_leaves_is_no_error() {
    let folder = Folder::new();
    let mut child = Command::new(cargo_bin!("ridgeway"))
        .args(["completions", "bash"])
        .current_dir(folder.0.path())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    drop(child.stdout.take());
    let output = child.wait_with_output().unwrap();
    assert_eq!((output.status.code(), output.stderr), (Some(0), Vec::new()));
}

#[test]
fn bad_input_is_named() {
    let folder = Folder::new();
    folder.bad(
        "info missing.tif",
        3,
        "missing.tif: there is no such file; check its name and the folder you are in",
    );
    folder.write("notes.txt", "hello\n");
    folder.bad(
        "info notes.txt",
        2,
        "notes.txt: the file is of no known format: it begins with bytes [68, 65, 6c, 6c, 6f, 0a]; \
         it must be GeoTIFF, ESRI ASCII grid or SRTM HGT",
    );
    folder.write("empty.geojson", r#"{"type":"FeatureCollection","features":[]}"#);
    folder.bad(
        "route range.tif --start empty.geojson --goal pixel:3,4",
        2,
        "empty.geojson: the number of points, lines and areas is 0; it must be 1 or more",
    );
    folder.bad(
        "route range.tif --start pixel:3,3 --goal pixel:3,4 --tensor range.tif",
        2,
        "range.tif: the number of bands is 1; it must be 3 for tensors: D11, D12, D22",
    );
    folder.bad(
        "route plain.tif --start huts.geojson --goal pixel:3,4",
        2,
        "huts.geojson: the CRS is unknown; it must be one that leads to longitude and latitude; \
         use map or grid coordinates, or set its CRS with `gdal_edit.py -a_srs EPSG:... FILE.tif`",
    );
}

#[test]
fn bad_outputs_are_refused_before_the_work() {
    let folder = Folder::new();
    let route = "route range.tif --start pixel:3,3 --goal pixel:50,30";
    folder.write("r.gpx", "precious");
    folder.bad(&format!("{route} -o r.gpx"), 2, "r.gpx: exists; give --overwrite to replace it");
    assert_eq!(folder.read("r.gpx"), "precious");
    folder.bad(
        &format!("{route} -o r.kml"),
        2,
        "r.kml: cannot tell the format from the name; end it in .geojson, .json, .gpx, .csv",
    );
    folder.bad(
        &format!("{route} -o no/r.csv"),
        2,
        "the folder no is missing; it must be there before no/r.csv is written; create it first",
    );
    folder.bad(&format!("{route} -o a.csv -o a.csv"), 2, "a.csv: named twice as an output");
    folder.bad(
        "surface range.tif -o range.tif --overwrite",
        2,
        "range.tif: is the DEM itself; choose another name for the output",
    );
    folder.bad(
        "compare range.tif --start pixel:3,3 --goal pixel:50,30 -o r.gpx",
        2,
        "r.gpx is a file; it must be a folder",
    );
}

#[test]
fn places_off_the_ground_are_explained() {
    let folder = Folder::new();
    let from = |start: &str, message: &str| {
        folder.bad(&format!("route range.tif --start {start} --goal pixel:50,30"), 2, message);
    };
    from(
        "1,2",
        "--start 1,2 lies outside the DEM, which reaches from 500000,5000000 to 501800,5001200; \
         the nearest place on it is 500000,5000000",
    );
    from(
        "-5000300,500300",
        "--start -5000300,500300 lies outside the DEM, which reaches from 500000,5000000 to \
         501800,5001200; the nearest place on it is 500000,5000000",
    );
    from(
        "5000300,500300",
        "--start 5000300,500300 lies outside the DEM, which reaches from 500000,5000000 to \
         501800,5001200; x and y look swapped: try 500300,5000300",
    );
    from(
        "lonlat:45.155,9.002",
        "--start lonlat:45.155,9.002 lies outside the DEM, which reaches from lonlat:9,45.153477 to \
         lonlat:9.022904,45.164277; longitude and latitude look swapped: try lonlat:9.002,45.155",
    );
    from(
        "pixel:61,3",
        "--start pixel:61,3 lies outside the DEM, which reaches from pixel:0,0 to pixel:60,40; \
         the nearest place on it is pixel:60,3",
    );
    folder.bad(
        "route split.asc --start pixel:2,1 --goal pixel:4,1",
        2,
        "--start pixel:2,1 lies on a void of the DEM; the nearest usable place is pixel:1,1",
    );
    folder.bad(
        "route range.tif --start pixel:3,3 --goal 500780,5000600 --barrier wall.geojson",
        2,
        "--goal 500780,5000600 lies on a barrier; the nearest usable place is 500750,5000600",
    );
    let steep = "route range.tif --start pixel:3,3 --goal pixel:50,30";
    folder.bad(
        &format!("{steep} --max-slope 3"),
        2,
        "--start pixel:3,3 lies on ground steeper than --max-slope allows; the nearest usable place is pixel:5,5",
    );
    let costs = format!("{}{}", "-1 ".repeat(10), "2 ".repeat(51)).repeat(41);
    folder.write(
        "cost.asc",
        &format!("ncols 61\nnrows 41\nxllcorner 499985\nyllcorner 4999985\ncellsize 30\nNODATA_value -1\n{costs}\n"),
    );
    folder.bad(
        &format!("{steep} --cost cost.asc"),
        2,
        "--start pixel:3,3 lies where --cost or --tensor has no value; the nearest usable place is pixel:10,3",
    );
    folder.bad(
        "route plain.tif --start lonlat:1,2 --goal pixel:4,1",
        2,
        "the CRS is unknown; it must be one that leads to longitude and latitude; use map or grid \
         coordinates, or set its CRS with `gdal_edit.py -a_srs EPSG:... FILE.tif`",
    );
    folder.bad(
        "route range.tif --start pixel:3,3 --goal wall.geojson",
        2,
        "--goal takes points; its file also holds lines or areas",
    );
}

#[test]
fn heights_that_no_terrain_has_are_blamed_on_no_flag() {
    let folder = Folder::new();
    let heights = "1e30 -1e30 0 5e29 ".repeat(25);
    folder.write(
        "huge.asc",
        &format!("ncols 10\nnrows 10\nxllcorner 0\nyllcorner 0\ncellsize 10\n{heights}\n"),
    );
    folder.bad(
        "compare huge.asc --start pixel:0,0 --goal pixel:1,0",
        2,
        "--start pixel:0,0 lies where the metric is too extreme to compute with, and so does every other cell",
    );
}

#[test]
fn a_climb_weight_beyond_what_the_grid_can_follow_is_told() {
    let folder = Folder::new();
    let line = "distance range.tif --start pixel:10,10 --climb-weight";
    for (flags, told) in [
        ("20", "on the curvature metric"),
        ("0.01", ""),
        ("20 -q", ""),
        ("20 --metric isotropic", ""),
        ("2000 --metric isotropic", "on the isotropic metric, 1.000: "),
    ] {
        let err = folder.run(&format!("{line} {flags}")).err;
        assert!(err.contains(told) && err.is_empty() == told.is_empty(), "{flags}: {err}");
    }
}

#[test]
fn no_way_is_an_answer_of_its_own() {
    let folder = Folder::new();
    folder.bad(
        "route split.asc --start pixel:0,1 --goal pixel:4,1",
        1,
        "--goal pixel:4,1 cannot be reached from the start: voids lie between; \
         the nearest place that can be reached is pixel:1,1",
    );
    for command in ["route", "compare"] {
        folder.bad(
            &format!(
                "{command} range.tif --start pixel:3,3 --goal pixel:50,4 --barrier wall.geojson"
            ),
            1,
            "--goal pixel:50,4 cannot be reached from the start: barriers lie between; \
             the nearest place that can be reached is pixel:25,4",
        );
    }
}

#[test]
fn bad_flags_are_explained() {
    let folder = Folder::new();
    let route = "route range.tif --start pixel:3,3 --goal pixel:50,30";
    for (flags, message) in [
        (
            "--metric euclid",
            "invalid value 'euclid' for '--metric <METRIC>'\n  \
             [possible values: isotropic, curvature, difference, difference-literal, tensor]",
        ),
        (
            "--delta -0.1",
            "invalid value '-0.1' for '--delta <1/M>': expected auto, auto:SHARE, or a curvature above 0 \
             in 1/m such as 0.001",
        ),
        (
            "--metric difference --difference-delta 0",
            "invalid value '0' for '--difference-delta <VALUE>': expected auto, auto:SHARE, or a number above 0",
        ),
        (
            "--smooth -3",
            "invalid value '-3' for '--smooth <METRES>': expected a length in metres, a number of cells \
             such as 16cells, auto, or 0",
        ),
        (
            "--max-slope 95",
            "invalid value '95' for '--max-slope <DEG>': expected an angle above 0 and up to 90 degrees",
        ),
        (
            "--start valley",
            "invalid value 'valley' for '--start <PLACE>': expected X,Y, lonlat:LON,LAT, pixel:COL,ROW or \
             a .geojson file",
        ),
        ("--threads 0", "invalid value '0' for '--threads <N>': 0 is not in 1..=1024"),
        ("--metric tensor", "the metric `tensor` needs --tensor FILE.tif"),
    ] {
        folder.bad(&format!("{route} {flags}"), 2, message);
    }
    folder.bad(
        "synth bumps --size 30 -o x.tif",
        2,
        "invalid value '30' for '--size <COLSxROWS>': expected columns and rows, for example 301x201, \
         and at most 268435456 cells",
    );
    folder.bad(
        "synth hills -o x.tif",
        2,
        "the kind of terrain is `hills`; it must be one of plane, cylinder, sphere, cone, bumps, \
         four-bumps, range, fractal, craters, switchbacks",
    );
    folder.bad(
        "render range.tif --start pixel:3,3 --goal pixel:9,9 --layer slope -o x.png",
        2,
        "routes are drawn on the hillshade only; leave --layer out",
    );
    folder.bad(
        "compare range.tif --start pixel:3,3 --goal huts.geojson -o cmp",
        2,
        "--goal huts.geojson holds 2 points; compare takes one goal",
    );
}

#[test]
fn segment_writes_labels_polygons_and_a_picture() {
    let folder = Folder::new();
    let text = folder.good(
        "segment range.tif --levels 2 -o regions.tif -o regions.geojson -o regions.png --threads 2",
    );
    assert!(text.contains("level 2") && text.contains("wrote regions.png\n"), "{text}");
    assert!(is_tiff(&folder.path("regions.tif")) && is_png(&folder.path("regions.png")));
    let raster = ridgeway::terrain::read_bands(folder.path("regions.tif")).unwrap();
    assert_eq!(raster.bands.len(), 2);
    let file = folder.json("regions.geojson");
    let features = file["features"].as_array().unwrap();
    let mut cells = [0, 0];
    for feature in features {
        let properties = &feature["properties"];
        let level = properties["level"].as_u64().unwrap() as usize;
        let region = properties["region"].as_f64().unwrap();
        let nodes = properties["nodes"].as_u64().unwrap();
        let labelled = raster.bands[level - 1].iter().filter(|label| **label == region).count();
        assert_eq!(nodes as usize, labelled);
        cells[level - 1] += nodes;
        assert_eq!(properties["parent"].is_null(), level == 1);
        assert_eq!(properties["signature"].as_array().unwrap().len(), 4);
        assert!(properties["area_m2"].as_f64().unwrap() >= 900.0 * nodes as f64);
        let kind = feature["geometry"]["type"].as_str().unwrap();
        assert!(kind == "Polygon" || kind == "MultiPolygon");
    }
    assert_eq!(cells, [61 * 41; 2]);
    assert_eq!(file["provenance"]["software"], format!("ridgeway {}", env!("CARGO_PKG_VERSION")));
    // The same on one thread.
    folder.good("segment range.tif --levels 2 -o again.tif --threads 1 -q");
    let again = ridgeway::terrain::read_bands(folder.path("again.tif")).unwrap();
    assert_eq!(again.bands, raster.bands);
}

#[test]
fn segment_takes_radii_metrics_and_merges() {
    let folder = Folder::new();
    let regions = |options: &str| {
        let out = folder.good(&format!("segment range.tif --json -q {options}"));
        let json: Value = serde_json::from_str(&out).unwrap();
        json["regions"].as_array().unwrap().len()
    };
    assert_eq!(regions("--epsilon 1e6"), 1);
    let many = regions("--epsilon 5");
    assert!(many > 5);
    assert!(regions("--epsilon 20,5") > many);
    assert!(regions("--epsilon 5 --merge 0.3") <= many);
    assert_eq!(regions("--epsilon 5 --merge 1"), 1);
    assert!(regions("--metric difference") > 1);
    // Voids split the terrain.
    let split = folder.good("segment split.asc --json -q --smooth 0 --epsilon 1e9");
    let json: Value = serde_json::from_str(&split).unwrap();
    assert_eq!(json["regions"].as_array().unwrap().len(), 2);
}

#[test]
fn segment_refuses_what_makes_no_sense() {
    let folder = Folder::new();
    folder.bad(
        "segment range.tif --epsilon 5,20",
        2,
        "the list of values of epsilon is [5.0, 20.0]; it must be one that falls from level to level",
    );
    folder.bad(
        "segment range.tif --epsilon 20,5 --levels 1",
        2,
        "the number of levels is 1; it must be 1 or more, and that of the values of epsilon, 2",
    );
    folder.bad(
        "segment range.tif --epsilon 0",
        2,
        "invalid value '0' for '--epsilon <VALUE>': expected a number above 0",
    );
    folder.bad(
        "segment range.tif -o regions.gpx",
        2,
        "regions.gpx: cannot tell the format from the name; end it in .geojson, .json, .tif, .tiff, .png",
    );
    folder.good("segment range.tif -o regions.tif -q");
    let again = folder.run("segment range.tif -o regions.tif");
    assert!(again.code == 2 && again.err.contains("regions.tif"), "{again:?}");
}

#[test]
fn match_finds_like_regions_of_one_terrain() {
    let folder = Folder::new();
    folder.good("synth four-bumps --size 101x101 -o four.tif");
    let text = folder.good("match four.tif --smooth 0 -o like");
    assert!(text.contains("four.tif: 4 regions\n"), "{text}");
    assert!(text.ends_with("wrote like/matches.json, like/regions.png, like/signatures.png\n"));
    assert!(
        is_png(&folder.path("like/regions.png")) && is_png(&folder.path("like/signatures.png"))
    );
    let found = folder.json("like/matches.json");
    assert_eq!(found["surfaces"][0]["regions"].as_array().unwrap().len(), 4);
    let pairs = found["matches"].as_array().unwrap();
    assert_eq!(pairs.len(), 2);
    for pair in pairs {
        assert!(pair["unlikeness"].as_f64().unwrap() < 0.05, "{pair}");
        assert!((pair["size_ratio"].as_f64().unwrap() - 1.0).abs() < 0.05, "{pair}");
    }
}

/// A bent sheet, 4 × 3 m, as a NURBS surface of degree 2 and 1.
const SHEET: &str = r#"{"degree":[2,1],"knots":[[0,0,0,1,1,1],[0,0,1,1]],
    "points":[[[0,0,0,1],[2,0,3,1],[4,0,0,1]],[[0,3,0,1],[2,3,1,1],[4,3,0,1]]]}"#;

#[test]
fn match_compares_terrain_and_surfaces_on_any_metric() {
    let folder = Folder::new();
    folder.write("sheet.json", SHEET);
    for metric in ["curvature", "difference", "difference-literal", "isotropic"] {
        let line = format!("match range.tif sheet.json --nodes 30x20 --metric {metric} --json -q");
        let json: Value = serde_json::from_str(&folder.good(&line)).unwrap();
        let counts = [0, 1].map(|i| json["surfaces"][i]["regions"].as_array().unwrap().len());
        let pairs = json["matches"].as_array().unwrap();
        assert_eq!(pairs.len(), counts[0].min(counts[1]));
        let seed = |i: usize| json["surfaces"][i]["regions"][0]["seed"].as_array().unwrap().len();
        assert_eq!([seed(0), seed(1)], [2, 3]);
    }
    // A surface and itself: each region is its own match.
    let json = folder.good("match sheet.json sheet.json --levels 2 --nodes 30x20 --json --sized");
    let json: Value = serde_json::from_str(&json).unwrap();
    for pair in json["matches"].as_array().unwrap() {
        assert_eq!(pair["unlikeness"], 0.0);
        assert_eq!(pair["size_ratio"], 1.0);
    }
}

#[test]
fn match_refuses_what_it_cannot_compare() {
    let folder = Folder::new();
    folder.bad("match range.tif --metric tensor", 2, "the metric `tensor` needs --tensor FILE.tif");
    folder.write("sheet.json", SHEET);
    folder.bad(
        "match range.tif sheet.json --max-slope 30",
        2,
        "--max-slope is for DEMs, and sheet.json is none",
    );
    folder.bad(
        "match sheet.json --nodes 1x20",
        2,
        "the number of nodes in the first direction of the surface is 1; it must be between 2 and 100000",
    );
    assert_eq!(folder.run("match range.tif plain.tif range.tif").code, 2);
    assert_eq!(folder.run("match nowhere.json").code, 3);
    folder.good("match plain.tif -o like -q");
    let again = folder.run("match plain.tif -o like");
    assert!(again.code == 2 && again.err.contains("matches.json"), "{again:?}");
}

#[test]
fn match_cuts_as_segment_does() {
    let folder = Folder::new();
    folder.write("sheet.json", SHEET);
    for flags in [
        "--epsilon 20,5 --delta 0.002",
        "--levels 2 --merge 0.2",
        "--metric difference --difference-delta auto:0.5 --accuracy high",
        "--max-slope 40 --climb-weight 0.1 --barrier wall.geojson",
    ] {
        let regions = |line: String| -> Vec<Value> {
            let json: Value = serde_json::from_str(&folder.good(&line)).unwrap();
            let all = json.pointer("/surfaces/0/regions").unwrap_or(&json["regions"]);
            all.as_array().unwrap().clone()
        };
        let mut cut = regions(format!("segment range.tif --json -q {flags}"));
        let finest = cut.iter().filter_map(|region| region["level"].as_u64()).max();
        cut.retain(|region| region["level"].as_u64() == finest);
        let matched = regions(format!("match range.tif --json -q {flags}"));
        assert_eq!(matched.len(), cut.len(), "{flags}");
        for (one, other) in matched.iter().zip(&cut) {
            assert_eq!(one["seed"], other["seed"], "{flags}");
            assert_eq!(one["signature"], other["signature"], "{flags}");
        }
    }
    let cut = folder.good("match sheet.json --nodes 30x20 --epsilon 0.5 --merge 0.1 --delta 0.3");
    assert!(cut.contains("best of all"), "{cut}");
}

#[test]
fn every_command_names_the_file_it_cannot_read() {
    let folder = Folder::new();
    fs::create_dir(folder.path("folder")).unwrap();
    for name in ["empty.tif", "empty.json", "empty.geojson"] {
        folder.write(name, "");
    }
    let places = "--start pixel:3,3 --goal pixel:50,30";
    let commands = |dem: &str| {
        [
            format!("info {dem}"),
            format!("surface {dem}"),
            format!("distance {dem} --start pixel:3,3"),
            format!("route {dem} {places}"),
            format!("compare {dem} {places}"),
            format!("segment {dem}"),
            format!("match {dem}"),
            format!("match range.tif {dem}"),
            format!("render {dem} -o x.png"),
            format!("route range.tif {places} --cost {dem}"),
            format!("route range.tif {places} --tensor {dem}"),
        ]
    };
    for (file, code, said) in [
        ("missing.tif", 3, "there is no such file; check its name and the folder you are in"),
        ("folder", 3, "is a folder; name a file"),
        ("empty.tif", 2, "the file is empty; it must be a DEM"),
    ] {
        for line in commands(file) {
            folder.bad(&line, code, &format!("{file}: {said}"));
        }
    }
    folder.bad(
        "match empty.json",
        2,
        "empty.json: the file is empty; it must be a surface in JSON",
    );
    folder.bad(
        &format!("route range.tif {places} --barrier empty.geojson"),
        2,
        "empty.geojson: the file is empty; it must be GeoJSON",
    );
}

#[test]
fn terrains_of_a_few_cells_are_cut_and_matched() {
    let folder = Folder::new();
    for (name, cols, rows, heights) in [
        ("row", 7, 1, "1 2 3 5 3 2 1"),
        ("column", 1, 7, "1 2 3 5 3 2 1"),
        ("pair", 2, 1, "5 6"),
        ("cell", 1, 1, "5"),
        ("island", 3, 3, "-9 -9 -9 -9 7 -9 -9 -9 -9"),
    ] {
        folder.write(
            &format!("{name}.asc"),
            &format!(
                "ncols {cols}\nnrows {rows}\nxllcorner 0\nyllcorner 0\ncellsize 10\n\
                 NODATA_value -9\n{heights}\n"
            ),
        );
        for flags in ["", "--metric difference --levels 3", "--epsilon 1e-9 --merge 0.2"] {
            folder.good(&format!("segment {name}.asc -q --overwrite -o x.png {flags}"));
            folder.good(&format!("match {name}.asc range.tif -q {flags}"));
        }
        folder.good(&format!("match {name}.asc -q -o {name} --epsilon 1e-9"));
    }
    let alone = folder.good("match cell.asc");
    assert!(alone.contains("cell.asc: 1 region\none region alone matches none"), "{alone}");
    let flat = folder.good("match row.asc --epsilon 1e-9");
    assert!(flat.contains("row.asc: 7 regions\nno pair of regions in which"), "{flat}");
    folder.write(
        "void.asc",
        "ncols 2\nnrows 1\nxllcorner 0\nyllcorner 0\ncellsize 10\nNODATA_value -9\n-9 -9\n",
    );
    let said =
        "error: void.asc: the number of heights that are not void is 0; it must be 1 or more\n";
    assert!(folder.run("surface void.asc").err.ends_with(said));
    let empty = folder.run("match range.tif void.asc");
    assert!(empty.code == 2 && empty.err.ends_with(said), "{empty:?}");
}

#[test]
fn bad_radii_levels_and_surfaces_are_refused() {
    let folder = Folder::new();
    for command in ["segment", "match"] {
        for radius in ["0", "-1", "NaN", "inf", "5,0"] {
            let bad = folder.run(&format!("{command} range.tif --epsilon {radius}"));
            assert!(bad.code == 2 && bad.err.contains("expected a number above 0"), "{bad:?}");
        }
        for levels in ["0", "50"] {
            let bad = folder.run(&format!("{command} range.tif --levels {levels}"));
            assert!(bad.code == 2 && bad.err.contains("is not in 1..=8"), "{bad:?}");
        }
    }
    folder.write("large.json", &SHEET.replace("[2,0,3,1]", "[2e300,0,3,1]"));
    folder.bad(
        "match large.json",
        2,
        "large.json: control point 1 is at [2e300, 0.0, 3.0] with weight 1.0; it must be finite and at \
         most 1e14 m from the origin",
    );
    folder.write("heavy.json", &SHEET.replace("[2,0,3,1]", "[2,0,3,1e300]"));
    folder.bad(
        "match heavy.json",
        2,
        "heavy.json: the weight of control point 1 is 1e300; it must be between 1e-9 and 1e9",
    );
    folder.write("list.json", "[]");
    folder.bad(
        "match list.json",
        2,
        "list.json: the surface in JSON is damaged: invalid length 0, expected an object with degree, knots \
         and points at line 1 column 2",
    );
    let many = folder.run("match range.tif --nodes 99999x99999");
    assert!(many.code == 2 && many.err.contains("at most 268435456 cells"), "{many:?}");
}
