//! The accuracy of distances and routes against closed forms, over resolution.
//!
//! `cargo run --release --example accuracy` prints the tables of `docs/measurements.md`.

use std::f64::consts::TAU;

use glam::DVec2;
use ridgeway::metric::Tensor;
use ridgeway::route::trace;
use ridgeway::synthetic::{Synthetic, SyntheticKind};
use ridgeway::{
    Control, Crs, Curvature, Degree, Delta, DistanceMap, Error, FitOptions, GridFrame, Ground,
    HeightSurface, Isotropic, Metric, MetricField, Modifiers, Smoothing, Solver, Stop, Sym2,
    Terrain,
};

const RESOLUTIONS: [usize; 4] = [101, 201, 401, 801];

fn main() -> Result<(), Error> {
    directions()?;
    farthest_off()?;
    println!(
        "\nMean error of the distance, relative to the mean distance; the order from each pair"
    );
    println!("| case | {} | last order |", RESOLUTIONS.map(|n| format!("{n}²")).join(" | "));
    println!("|---|---|---|---|---|---|");
    constants()?;
    cylinder()?;
    sphere()?;
    routes()?;
    rounding()
}

/// A square of `n × n` nodes and side 1 m, centred at (0, 0).
fn square(n: usize) -> Result<GridFrame, Error> {
    let h = 1.0 / (n - 1) as f64;
    GridFrame::new(n, n, DVec2::new(-0.5, 0.5), DVec2::splat(h), Ground::METRES)
}

fn surface(n: usize, height: impl Fn(DVec2) -> f64) -> Result<HeightSurface, Error> {
    let frame = square(n)?;
    let nodes = (0..n).flat_map(|row| (0..n).map(move |col| DVec2::new(col as f64, row as f64)));
    let heights = nodes.map(|at| height(frame.to_map(at))).collect();
    let terrain = Terrain::new(frame, heights, Crs::none())?;
    let options = FitOptions { degree: Degree::Cubic, smoothing: Smoothing::Interpolate };
    HeightSurface::fit(&terrain, &options, &Control::default())
}

fn map_of<'a>(metric: &MetricField<'a>) -> &'a GridFrame {
    metric.surface().frame().expect("a heightmap")
}

fn solve(metric: &MetricField<'_>, start: DVec2) -> Result<DistanceMap, Error> {
    let start = map_of(metric).to_grid(start);
    Solver::default().solve(metric, &[start.into()], &Stop::Never, &Control::default())
}

/// Mean error over the nodes relative to the mean distance.
fn mean_error(map: &DistanceMap, frame: &GridFrame, exact: impl Fn(DVec2) -> f64) -> f64 {
    let (mut error, mut total) = (0.0, 0.0);
    for row in 0..frame.rows() {
        for col in 0..frame.cols() {
            let g = exact(frame.to_map(DVec2::new(col as f64, row as f64)));
            error += (map.at_node(col, row) - g).abs();
            total += g;
        }
    }
    error / total
}

/// Prints a row of the table.
fn row(case: &str, error: impl Fn(usize) -> Result<f64, Error>) -> Result<(), Error> {
    let errors = RESOLUTIONS.into_iter().map(error).collect::<Result<Vec<_>, _>>()?;
    let order = (errors[2] / errors[3]).log2();
    let cells: Vec<String> = errors.iter().map(|e| format!("{e:.1e}")).collect();
    println!("| {case} | {} | {order:.2} |", cells.join(" | "));
    Ok(())
}

/// On a flat plane: the error of the distance at 200 cells in every direction.
fn directions() -> Result<(), Error> {
    let n = 441;
    let plane = surface(n, |_| 0.0)?;
    let metric = Isotropic.on(&plane, &Modifiers::default(), &Control::default())?;
    let map = solve(&metric, DVec2::ZERO)?;
    let radius = 200.0 / (n - 1) as f64;
    let worst = (0..3600)
        .map(|k| radius * DVec2::from_angle(TAU * f64::from(k) / 3600.0))
        .filter_map(|at| map.at(plane.frame().to_grid(at)))
        .map(|g| (g / radius - 1.0).abs())
        .fold(0.0, f64::max);
    println!("Flat plane, worst direction at 200 cells: {:.3} %", 100.0 * worst);
    Ok(())
}

/// The largest relative error more than 200 cells from the source on 1001² nodes, by ratio of the tensor.
fn farthest_off() -> Result<(), Error> {
    let n = 1001;
    let plane = surface(n, |_| 0.0)?;
    let frame = plane.frame();
    for ratio in [1.0, 4.0, 25.0, 100.0] {
        let along = DVec2::from_angle(0.5);
        let tensor = Sym2::outer(along) * ratio + Sym2::outer(along.perp());
        let metric = Tensor { tensors: vec![tensor; n * n].into() };
        let map =
            solve(&metric.on(&plane, &Modifiers::default(), &Control::default())?, DVec2::ZERO)?;
        let relative = |i: usize| {
            let at = frame.to_map(DVec2::new((i % n) as f64, (i / n) as f64));
            let exact = tensor.inverse().norm(at);
            let far = at.length() > 0.2;
            if far { (map.at_node(i % n, i / n) / exact - 1.0).abs() } else { 0.0 }
        };
        let worst = (0..n * n).map(relative).fold(0.0, f64::max);
        println!("Ratio {ratio}, largest error beyond 200 cells: {:.2} %", 100.0 * worst);
    }
    Ok(())
}

fn constants() -> Result<(), Error> {
    for ratio in [1.0, 4.0, 25.0, 100.0] {
        let along = DVec2::from_angle(0.5);
        let tensor = Sym2::outer(along) * ratio + Sym2::outer(along.perp());
        row(&format!("constant tensor, ratio {ratio}"), |n| {
            let plane = surface(n, |_| 0.0)?;
            let metric = Tensor { tensors: vec![tensor; n * n].into() };
            let map = solve(
                &metric.on(&plane, &Modifiers::default(), &Control::default())?,
                DVec2::ZERO,
            )?;
            Ok(mean_error(&map, plane.frame(), |at| tensor.inverse().norm(at)))
        })?;
    }
    row("plane of slope 0.5, isotropic", |n| {
        let plane = surface(n, |at| 0.5 * at.x)?;
        let map =
            solve(&Isotropic.on(&plane, &Modifiers::default(), &Control::default())?, DVec2::ZERO)?;
        Ok(mean_error(&map, plane.frame(), |at| (1.25 * at.x * at.x + at.y * at.y).sqrt()))
    })
}

/// Radius of the cylinder and of the sphere, m, and `δ`, 1/m.
const RADIUS: f64 = 0.8;
const DELTA: f64 = 0.25;

fn cylinder_surface(n: usize) -> Result<HeightSurface, Error> {
    surface(n, |at| RADIUS - (RADIUS * RADIUS - at.x * at.x).sqrt())
}

/// Arc length and distance along the axis: the cylinder unrolled.
fn unrolled(at: DVec2) -> DVec2 {
    DVec2::new(RADIUS * (at.x / RADIUS).asin(), at.y)
}

fn metrics() -> [(&'static str, Box<dyn Metric>, DVec2); 2] {
    // Slownesses along the arc and along the axis.
    let curved = (DELTA + 1.0 / RADIUS).sqrt();
    [
        ("isotropic", Box::new(Isotropic), DVec2::ONE),
        (
            "curvature",
            Box::new(Curvature { delta: Delta::Absolute(DELTA) }),
            DVec2::new(curved, DELTA.sqrt()),
        ),
    ]
}

fn cylinder() -> Result<(), Error> {
    let start = DVec2::new(-0.2, 0.1);
    for (name, metric, slowness) in metrics() {
        row(&format!("cylinder, {name}"), |n| {
            let trough = cylinder_surface(n)?;
            let map =
                solve(&metric.on(&trough, &Modifiers::default(), &Control::default())?, start)?;
            let exact = |at| (slowness * (unrolled(at) - unrolled(start))).length();
            Ok(mean_error(&map, trough.frame(), exact))
        })?;
    }
    Ok(())
}

fn sphere() -> Result<(), Error> {
    for (name, metric, slowness) in metrics() {
        row(&format!("sphere cap, {name}"), |n| {
            let cap = surface(n, |at| (RADIUS * RADIUS - at.length_squared()).sqrt())?;
            let map =
                solve(&metric.on(&cap, &Modifiers::default(), &Control::default())?, DVec2::ZERO)?;
            let exact = |at: DVec2| slowness.x * RADIUS * (at.length() / RADIUS).asin();
            Ok(mean_error(&map, cap.frame(), exact))
        })?;
    }
    Ok(())
}

/// Largest and median over many goals of a route's farthest deviation from the exact line, in cells. `unfold` maps
/// the square to a plane in which exact routes are straight.
fn deviation(
    metric: &MetricField<'_>,
    start: DVec2,
    goals: &[DVec2],
    unfold: impl Fn(DVec2) -> DVec2,
) -> Result<[f64; 2], Error> {
    let frame = map_of(metric);
    let map = solve(metric, start)?;
    let mut worst = Vec::new();
    for &goal in goals {
        let route = trace(&map, metric, frame.to_grid(goal))?;
        let (from, along) = (unfold(start), (unfold(goal) - unfold(start)).normalize());
        let stray = |p: &glam::DVec3| (unfold(p.truncate()) - from).perp_dot(along).abs();
        worst.push(route.points.iter().map(stray).fold(0.0, f64::max) / frame.step().x);
    }
    worst.sort_by(f64::total_cmp);
    Ok([worst[worst.len() - 1], worst[worst.len() / 2]])
}

fn routes() -> Result<(), Error> {
    println!("\nDeviation of 40 routes from the exact line in cells, largest (median)");
    println!("| case | {} |", RESOLUTIONS.map(|n| format!("{n}²")).join(" | "));
    println!("|---|---|---|---|---|");
    let goals: Vec<DVec2> =
        (0..40).map(|k| 0.3 * DVec2::from_angle(TAU * f64::from(k) / 40.0)).collect();
    let mut cells = Vec::new();
    for n in RESOLUTIONS {
        let trough = cylinder_surface(n)?;
        let [_, (_, metric, slowness)] = metrics();
        let metric = metric.on(&trough, &Modifiers::default(), &Control::default())?;
        let [most, median] = deviation(&metric, DVec2::ZERO, &goals, |at| {
            slowness * unrolled(at) / slowness.max_element()
        })?;
        cells.push(format!("{most:.0e} ({median:.0e})"));
    }
    println!("| cylinder, curvature | {} |", cells.join(" | "));
    cells.clear();
    // D = (ΦᵀΦ)⁻¹, Φ = Dφ: routes are preimages of straight lines.
    let phi =
        |at: DVec2| DVec2::new(at.x + 0.1 * (TAU * at.y).sin(), at.y + 0.1 * (TAU * at.x).sin());
    for n in RESOLUTIONS {
        let plane = surface(n, |_| 0.0)?;
        let frame = plane.frame();
        let tensors = (0..n * n).map(|i| {
            let at = frame.to_map(DVec2::new((i % n) as f64, (i / n) as f64));
            let (a, b) = (0.1 * TAU * (TAU * at.y).cos(), 0.1 * TAU * (TAU * at.x).cos());
            Sym2::new(1.0 + b * b, a + b, 1.0 + a * a).inverse()
        });
        let metric = Tensor { tensors: tensors.collect() };
        let metric = metric.on(&plane, &Modifiers::default(), &Control::default())?;
        let [most, median] = deviation(&metric, DVec2::ZERO, &goals, phi)?;
        cells.push(format!("{most:.0e} ({median:.0e})"));
    }
    println!("| diffeomorphism | {} |", cells.join(" | "));
    Ok(())
}

/// How much of the curvature is noise when heights are rounded to whole metres, as SRTM's are, by the cut-off of
/// the fit: the root-mean-square change of the curvatures over the root-mean-square curvature.
fn rounding() -> Result<(), Error> {
    let cutoffs = [0.0, 3.0, 4.0, 6.0, 8.0];
    println!(
        "\nCurvature that is noise of heights in whole metres, 30 m cells, by cut-off in cells"
    );
    println!("| terrain | {} |", cutoffs.map(|c| c.to_string()).join(" | "));
    println!("|---|---|---|---|---|---|");
    for kind in [SyntheticKind::Range, SyntheticKind::Craters, SyntheticKind::Plane] {
        let heights = Synthetic::new(kind, 301, 301, 30.0)?.with_seed(1).heights();
        let rounded = heights.iter().map(|z| z.round()).collect();
        let frame = GridFrame::new(301, 301, DVec2::ZERO, DVec2::splat(30.0), Ground::METRES)?;
        let [exact, rounded] =
            [heights, rounded].map(|heights| Terrain::new(frame.clone(), heights, Crs::none()));
        let (exact, rounded) = (exact?, rounded?);
        let noise = cutoffs.map(|cells| {
            let smoothing =
                if cells > 0.0 { Smoothing::CutoffCells(cells) } else { Smoothing::Interpolate };
            let options = FitOptions { smoothing, ..FitOptions::default() };
            let fit = |terrain| HeightSurface::fit(terrain, &options, &Control::default());
            Ok::<_, Error>(curvature_change(&fit(&exact)?, &fit(&rounded)?))
        });
        let cells = noise.into_iter().collect::<Result<Vec<_>, _>>()?;
        println!("| {kind} | {} |", cells.join(" | "));
    }
    Ok(())
}

fn curvature_change(exact: &HeightSurface, rounded: &HeightSurface) -> String {
    let frame = exact.frame();
    let mut sum = 0.0;
    for i in 0..frame.nodes() {
        let at = DVec2::new((i % frame.cols()) as f64, (i / frame.cols()) as f64);
        let [a, b] = [exact, rounded].map(|surface| surface.jet(at).curvature().principal);
        sum += 0.5 * ((a[0] - b[0]).powi(2) + (a[1] - b[1]).powi(2));
    }
    let change = (sum / frame.nodes() as f64).sqrt();
    format!("{:.1e} of {:.1e} 1/m", change, exact.rms_curvature())
}
