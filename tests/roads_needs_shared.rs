//! Routes against real mountain roads, the measurement behind the default cut-off and `δ`
//! (`docs/mathematics.md`). Roads © OpenStreetMap contributors, ODbL 1.0.
//!
//! `cargo test --release --test roads_needs_shared -- --ignored --nocapture` prints the table.

use std::path::{Path, PathBuf};

use glam::DVec2;
use ridgeway::route::trace;
use ridgeway::{
    Control, Curvature, Delta, FitOptions, HeightSurface, Isotropic, Metric, Modifiers, Smoothing,
    Solver, Stop, Terrain,
};

fn shared(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/data").join(path)
}

/// A road as grid coordinates.
fn road(name: &str, terrain: &Terrain) -> Vec<DVec2> {
    let text = std::fs::read_to_string(shared(&format!("roads/andorra_{name}.geojson"))).unwrap();
    let json: serde_json::Value = serde_json::from_str(&text).unwrap();
    let feature = json.get("features").map_or(&json, |features| &features[0]);
    let geometry = feature.get("geometry").unwrap_or(feature);
    let point = |p: &serde_json::Value| DVec2::new(p[0].as_f64().unwrap(), p[1].as_f64().unwrap());
    let points = geometry["coordinates"].as_array().unwrap();
    points.iter().map(|p| terrain.from_lonlat(point(p)).unwrap()).collect()
}

/// Share of the road's length that lies within 200 m of the route; 75 m cells.
fn share(road: &[DVec2], route: &[DVec2]) -> f64 {
    const NEAR: f64 = 200.0 / 75.0;
    let to_route = |p: DVec2| {
        let near = route.windows(2).map(|ends| {
            let w = ends[1] - ends[0];
            let t = ((p - ends[0]).dot(w) / w.length_squared().max(1e-30)).clamp(0.0, 1.0);
            p.distance(ends[0].lerp(ends[1], t))
        });
        near.fold(f64::INFINITY, f64::min)
    };
    let (near, all) = road.windows(2).fold((0.0, 0.0), |(near, all), ends| {
        let length = ends[0].distance(ends[1]);
        let close = to_route(ends[0].midpoint(ends[1])) < NEAR;
        (near + if close { length } else { 0.0 }, all + length)
    });
    near / all
}

/// Mean share over the three roads.
fn mean_share(surface: &HeightSurface, metric: &dyn Metric, roads: &[Vec<DVec2>]) -> f64 {
    let control = Control::default();
    let field = metric.on(surface, &Modifiers::default(), &Control::default()).unwrap();
    let shares = roads.iter().map(|road| {
        let (start, goal) = (road[0], road[road.len() - 1]);
        let map = Solver::default()
            .solve(&field, &[start.into()], &Stop::AllGoals(vec![goal]), &control)
            .unwrap();
        share(road, &trace(&map, &field, goal).unwrap().grid)
    });
    shares.sum::<f64>() / roads.len() as f64
}

#[test]
#[ignore = "needs ../shared"]
fn curvature_routes_are_nearer_to_real_roads_than_geodesics() {
    let terrain = Terrain::open(shared("dem/andorra_utm31n_75m.tif")).unwrap();
    let roads = ["ordino", "envalira", "beixalis"].map(|name| road(name, &terrain));
    println!("cut-off, cells | isotropic | delta = .03 | .05 | .1 | .2 | .4 of the rms curvature");
    for cells in [0.0, 4.0, 6.0, 8.0, 10.0, 12.0, 16.0, 24.0, 32.0] {
        let smoothing =
            if cells > 0.0 { Smoothing::CutoffCells(cells) } else { Smoothing::Interpolate };
        let options = FitOptions { smoothing, ..FitOptions::default() };
        let surface = HeightSurface::fit(&terrain, &options, &Control::default()).unwrap();
        let isotropic = mean_share(&surface, &Isotropic, &roads);
        let curvature = [0.03, 0.05, 0.1, 0.2, 0.4]
            .map(|share| mean_share(&surface, &Curvature { delta: Delta::Auto(share) }, &roads));
        println!("{cells} | {isotropic:.2} | {curvature:.2?}");
        if cells == FitOptions::DEFAULT_CUTOFF_CELLS {
            assert!(curvature[2] > isotropic + 0.15, "{} {isotropic}", curvature[2]);
        }
    }
}
