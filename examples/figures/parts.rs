//! Surfaces with like parts, cut into regions: figures 7 and 9.

use glam::{DVec2, DVec3};
use ridgeway::eikonal::TensorField;
use ridgeway::geo_types::Line;
use ridgeway::metric::{Difference, Metric};
use ridgeway::region::{
    Neighbours, SegmentOptions, Segmentation, Signature, gaussian_ranks, signatures,
};
use ridgeway::synthetic::{Synthetic, SyntheticKind};
use ridgeway::{
    Control, Crs, Curvature, FitOptions, HeightSurface, Modifiers, NurbsCurve, NurbsGrid,
    NurbsSurface, Result, Smoothing, Solver, StartRegion, Stop, Surface,
};

use super::shapes::knight;

/// A surface cut into regions.
pub(crate) struct Cut {
    pub(crate) name: &'static str,
    pub(crate) surface: Box<dyn Surface>,
    pub(crate) labels: Vec<Option<u32>>,
    pub(crate) signatures: Vec<Signature>,
}

impl Cut {
    fn new(
        name: &'static str,
        surface: Box<dyn Surface>,
        labels: Vec<Option<u32>>,
    ) -> Result<Self> {
        let signatures = signatures(&*surface, &labels, Neighbours::Surface, &Control::default())?;
        Ok(Self { name, surface, labels, signatures })
    }

    /// Cut by the difference metric: each node belongs to the nearest of some lines of nodes around, one in each part.
    fn by_rings(name: &'static str, surface: NurbsGrid, rows: &[f64]) -> Result<Self> {
        let labels = nearest_rings(&surface, rows)?;
        Self::new(name, Box::new(surface), labels)
    }
}

/// Which of some lines of nodes around, given as shares of all rows, each node is nearest to under the difference metric.
pub(crate) fn nearest_rings(surface: &NurbsGrid, rows: &[f64]) -> Result<Vec<Option<u32>>> {
    let control = Control::default();
    let ring = |&row: &f64| {
        let row = row * (surface.rows() - 1) as f64;
        StartRegion::from(Line::new((0.0, row), (surface.cols() as f64, row)))
    };
    let starts: Vec<_> = rows.iter().map(ring).collect();
    let metric = Difference::default().on(surface, &Modifiers::default(), &control)?;
    Ok(Solver::default().solve(&metric, &starts, &Stop::Never, &control)?.allocation())
}

/// Two surfaces with like parts, and the names of the parts of each.
pub(crate) type Pair = ([Cut; 2], [&'static [&'static str]; 2]);

/// Two letters G, the second larger and with another section.
pub(crate) fn letters() -> Result<Pair> {
    let letter = |name, scale, radii| {
        let surface = swept_letter(scale, radii)?.on_grid(48, 160)?;
        Cut::by_rings(name, surface, &[0.35, 0.78, 0.96])
    };
    let cuts = [letter("G", 1.0, [0.2, 0.17])?, letter("larger G", 1.7, [0.21, 0.165])?];
    Ok((cuts, [&["arc", "bend", "bar"]; 2]))
}

/// The letter G swept by an ellipse with radii in and across its plane; 2 m high for a scale of 1.
pub(crate) fn swept_letter(scale: f64, radii: [f64; 2]) -> Result<NurbsSurface> {
    // An arc, a bend upwards and the bar inwards.
    let arc = (0..=14).map(|i| DVec2::from_angle((45.0 + 20.0 * f64::from(i)).to_radians()));
    let bar = [[0.86, -0.3], [0.84, -0.1], [0.66, 0.02], [0.45, 0.03], [0.25, 0.03]];
    let points: Vec<DVec3> =
        arc.chain(bar.map(DVec2::from)).map(|p| p.extend(0.0) * scale).collect();
    let [x, y] = [DVec3::X * radii[0], DVec3::Y * radii[1]].map(|v| v * scale);
    let section = NurbsCurve::ellipse(DVec3::ZERO, x, y)?;
    NurbsSurface::sweep(&section, &NurbsCurve::through(&points, 3)?, DVec3::Z, 80)
}

/// The body of an ant, and a bishop whose head is the ant's tail, smaller and the other way up.
pub(crate) fn pieces() -> Result<Pair> {
    let turned = |profile: &[[f64; 2]], nodes: [usize; 2]| {
        let points: Vec<DVec3> = profile.iter().map(|&[r, z]| DVec3::new(r, 0.0, z)).collect();
        let profile = NurbsCurve::through(&points, 3)?;
        NurbsSurface::revolve(&profile, DVec3::ZERO, DVec3::Z)?.on_grid(nodes[0], nodes[1])
    };
    let head = arc(2.1, [0.4, 0.36], [90.0, -50.0]);
    let thorax = arc(1.3, [0.27, 0.35], [45.0, -45.0]);
    let tail = arc(0.0, [0.5, 0.75], [55.0, -90.0]);
    let ant: Vec<_> = head.chain(thorax).chain(tail).collect();
    let head = arc(2.6, [0.3, 0.45], [90.0, -55.0]);
    let bead = arc(1.82, [0.162, 0.21], [45.0, -45.0]);
    let stem = [[0.15, 1.4], [0.2, 1.1], [0.3, 0.8], [0.45, 0.5]];
    let foot = arc(0.1, [0.6, 0.2], [20.0, -45.0]);
    let bishop: Vec<_> = head.chain(bead).chain(stem).chain(foot).collect();
    let cuts = [
        Cut::by_rings("ant", turned(&ant, [96, 200])?, &[0.8, 0.38, 0.16])?,
        Cut::by_rings("bishop", turned(&bishop, [96, 200])?, &[0.15, 0.42, 0.8])?,
    ];
    Ok((cuts, [&["tail", "thorax", "ant's head"], &["tail", "bead", "foot"]]))
}

/// Radius and height on an ellipse around the axis, between two angles in degrees above its equator.
fn arc(centre: f64, radii: [f64; 2], [from, to]: [f64; 2]) -> impl Iterator<Item = [f64; 2]> {
    (0..=10).map(move |i| {
        let (sin, cos) = (from + (to - from) * f64::from(i) / 10.0).to_radians().sin_cos();
        // At the pole exactly on the axis.
        [if cos < 1e-9 { 0.0 } else { radii[0] * cos }, centre + radii[1] * sin]
    })
}

/// The knight and its reweighted twin.
pub(crate) fn knights() -> Result<Pair> {
    // Places on the profile, and where a Möbius map of ratio 1/2 puts them.
    let rows = [0.1, 0.36, 0.55, 0.85];
    let moved = rows.map(|s| 0.5 * s / (1.0 - 0.5 * s));
    let cut = |name, ratio, rows: &[f64]| {
        Cut::by_rings(name, knight()?.reweighted(1, ratio)?.on_grid(200, 320)?, rows)
    };
    let cuts = [cut("knight", 1.0, &rows)?, cut("reweighted knight", 0.5, &moved)?];
    Ok((cuts, [&["knight's head", "collar", "body", "knight's foot"]; 2]))
}

/// The four bumps of figure 6, segmented as there.
pub(crate) fn bumps() -> Result<Cut> {
    let bumps = Synthetic::new(SyntheticKind::FourBumps, 201, 201, 10.0)?;
    let terrain = bumps.terrain(Crs::none(), DVec2::ZERO)?;
    let options = FitOptions { smoothing: Smoothing::Interpolate, ..FitOptions::default() };
    let surface = HeightSurface::fit(&terrain, &options, &Control::default())?;
    let control = Control::default();
    let metric = Curvature::default().on(&surface, &Modifiers::default(), &control)?;
    let field = TensorField::sample(&metric, &control)?;
    let options = SegmentOptions::default();
    let cut = Segmentation::of(&field, &gaussian_ranks(&surface), &options, &control)?;
    Cut::new("bumps", Box::new(surface), cut.levels[0].labels.clone())
}

/// A region in figure 7.
pub(crate) struct Point {
    /// Like parts have one name.
    pub(crate) part: &'static str,
    pub(crate) signature: Signature,
    /// Whether it is of the second surface of a pair.
    pub(crate) second: bool,
}

/// The regions of all surfaces but those that have no like one.
pub(crate) fn points() -> Result<Vec<Point>> {
    let mut points = Vec::new();
    let mut add = |cut: &Cut, parts: &[&'static str], second| {
        let named = cut.signatures.iter().zip(parts);
        points.extend(named.map(|(&signature, part)| Point { part, signature, second }));
    };
    for (cuts, parts) in [letters()?, pieces()?, knights()?] {
        add(&cuts[0], parts[0], false);
        add(&cuts[1], parts[1], true);
    }
    add(&bumps()?, &["bump"; 4], false);
    let count = |part: &str| points.iter().filter(|p| p.part == part).count();
    let alone: Vec<bool> = points.iter().map(|p| count(p.part) == 1).collect();
    let pairs = points.into_iter().zip(alone);
    Ok(pairs.filter_map(|(point, alone)| (!alone).then_some(point)).collect())
}

/// How well like parts are distinguished from others: the share of points whose nearest one is of the same part, and the mean
/// silhouette (Rousseeuw 1987).
pub(crate) fn separation(points: &[Point]) -> [f64; 2] {
    let mut sums = [0.0; 2];
    for (i, point) in points.iter().enumerate() {
        let mean = |part: &str| {
            let others = points.iter().enumerate().filter(|(j, q)| *j != i && q.part == part);
            let apart = others.map(|(_, q)| point.signature.distance(&q.signature));
            let (sum, count) = apart.fold((0.0, 0.0), |(sum, count), d| (sum + d, count + 1.0));
            sum / count
        };
        let others = || points.iter().enumerate().filter(|(j, _)| *j != i).map(|(_, q)| q);
        let apart = |q: &&Point| point.signature.distance(&q.signature);
        let nearest = others().min_by(|a, b| apart(a).total_cmp(&apart(b)));
        sums[0] += f64::from(u8::from(nearest.is_some_and(|q| q.part == point.part)));
        let within = mean(point.part);
        let nearest_other = others()
            .filter(|q| q.part != point.part)
            .map(|q| mean(q.part))
            .fold(f64::INFINITY, f64::min);
        sums[1] += (nearest_other - within) / nearest_other.max(within);
    }
    sums.map(|sum| sum / points.len() as f64)
}
