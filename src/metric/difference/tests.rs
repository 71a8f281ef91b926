use std::f64::consts::{FRAC_PI_2, PI, SQRT_2};
use std::sync::Arc;

use glam::{DVec2, DVec3};

use super::DifferenceForm::{Literal, Rate};
use super::*;
use crate::control::CancelToken;
use crate::error::Error;
use crate::grid::{GridFrame, Ground};
use crate::metric::{Isotropic, Modifiers};
use crate::surface::{FitOptions, HeightSurface, Jet, Smoothing, SurfaceJet};
use crate::terrain::{Crs, Terrain};

/// The surface of a formula, whose parameters are `origin` at node (0, 0) and change by `steps` per column and per row.
struct Formula<F: Fn(DVec2) -> SurfaceJet + Sync> {
    counts: [usize; 2],
    origin: DVec2,
    steps: [DVec2; 2],
    periodic: [bool; 2],
    voids: fn(usize, usize) -> bool,
    jet: F,
}

impl<F: Fn(DVec2) -> SurfaceJet + Sync> Surface for Formula<F> {
    fn cols(&self) -> usize {
        self.counts[0]
    }

    fn rows(&self) -> usize {
        self.counts[1]
    }

    fn periodic(&self) -> [bool; 2] {
        self.periodic
    }

    fn is_void(&self, col: usize, row: usize) -> bool {
        (self.voids)(col, row)
    }

    fn jet(&self, at: DVec2) -> Jet {
        let [a, b] = self.steps;
        let SurfaceJet { point, first: [s1, s2], second: [s11, s12, s22] } =
            (self.jet)(self.origin + a * at.x + b * at.y);
        let second = |v: DVec2, w: DVec2| {
            s11 * (v.x * w.x) + s12 * (v.x * w.y + v.y * w.x) + s22 * (v.y * w.y)
        };
        Jet::Space(SurfaceJet {
            point,
            first: [s1 * a.x + s2 * a.y, s1 * b.x + s2 * b.y],
            second: [second(a, a), second(a, b), second(b, b)],
        })
    }
}

/// A formula over the unit square.
fn square<F: Fn(DVec2) -> SurfaceJet + Sync>(side: usize, jet: F) -> Formula<F> {
    let step = 1.0 / (side - 1) as f64;
    Formula {
        counts: [side; 2],
        origin: DVec2::ZERO,
        steps: [DVec2::X * step, DVec2::Y * step],
        periodic: [false; 2],
        voids: |_, _| false,
        jet,
    }
}

fn changes_of(surface: &dyn Surface, form: DifferenceForm) -> Vec<Change> {
    let curvature_delta = Delta::Absolute(0.25);
    let difference = Difference { form, curvature_delta, ..Difference::default() };
    difference.changes(surface, &Control::default()).unwrap()
}

fn error(a: Sym2, b: Sym2) -> f64 {
    let e = a + b * -1.0;
    e.xx.abs().max(e.xy.abs()).max(e.yy.abs())
}

/// A plane.
fn plane(at: DVec2) -> SurfaceJet {
    SurfaceJet {
        point: DVec3::new(at.x, at.y, 2.0 * at.x),
        first: [DVec3::new(1.0, 0.0, 2.0), DVec3::Y],
        second: [DVec3::ZERO; 3],
    }
}

/// A cylinder of radius 2 over `x` in quarters of a turn.
fn cylinder(at: DVec2) -> SurfaceJet {
    let (sin, cos) = (FRAC_PI_2 * at.x).sin_cos();
    let outward = DVec3::new(sin, 0.0, cos) * 2.0;
    SurfaceJet {
        point: outward + DVec3::Y * at.y,
        first: [DVec3::new(cos, 0.0, -sin) * PI, DVec3::Y],
        second: [outward * -FRAC_PI_2.powi(2), DVec3::ZERO, DVec3::ZERO],
    }
}

/// The graph of `f(x, y)`, given with its derivatives `x, y, xx, xy, yy`.
fn graph(at: DVec2, [f, x, y, xx, xy, yy]: [f64; 6]) -> SurfaceJet {
    SurfaceJet {
        point: at.extend(f),
        first: [DVec3::new(1.0, 0.0, x), DVec3::new(0.0, 1.0, y)],
        second: [xx, xy, yy].map(|second| DVec3::Z * second),
    }
}

/// `z = x²/2`, whose curvature is `(1 + x²)^(−3/2)`.
fn parabola(at: DVec2) -> SurfaceJet {
    graph(at, [0.5 * at.x * at.x, at.x, 0.0, 1.0, 0.0, 0.0])
}

/// Hills without any symmetry, not flat anywhere near the origin.
fn hills(at: DVec2) -> SurfaceJet {
    let (x, y) = (at.x, at.y);
    let (sin, cos) = (x + 0.3 * y).sin_cos();
    graph(at, [cos + 0.3 * y * y, -sin, -0.3 * sin + 0.6 * y, -cos, -0.3 * cos, -0.09 * cos + 0.6])
}

#[test]
fn planes_cylinders_and_spheres_do_not_change() {
    let sphere = |at: DVec2| {
        let (x, y) = (at.x, at.y);
        let z = (4.0 - x * x - y * y).sqrt();
        let second = |v: f64, w: f64, same: f64| -same / z - v * w / z.powi(3);
        graph(at, [z, -x / z, -y / z, second(x, x, 1.0), second(x, y, 0.0), second(y, y, 1.0)])
    };
    let still = |surface: &dyn Surface| {
        let changes = changes_of(surface, Rate);
        changes.iter().map(|change| change.gamma.xx + change.gamma.yy).fold(0.0, f64::max)
    };
    let largest =
        [still(&square(9, plane)), still(&square(33, cylinder)), still(&square(33, sphere))];
    assert!(largest.iter().all(|&gamma| gamma < 1e-6), "{largest:?}");
    // In space they turn. κ = 1/2, δ = 1/4
    let side = 201;
    let square_rate = (SQRT_2 * 0.5 / 0.75 * PI / (side - 1) as f64).powi(2);
    for change in changes_of(&square(side, cylinder), Literal) {
        assert!(error(change.gamma, Sym2::new(2.0 * square_rate, 0.0, 0.0)) < 1e-3 * square_rate);
    }
}

#[test]
fn growing_curvature_is_differentiated_with_second_order() {
    // C = s ttᵀ + yyᵀ/δ: ‖∇C‖ along the arc length a is |ds/da|.
    let exact = |x: f64| {
        let w = 1.0 + x * x;
        let (kappa, slope) = (w.powf(-1.5), -3.0 * x * w.powf(-2.5) / w.sqrt());
        let s = 1.0 / (0.25 + kappa);
        Sym2::new((s * s * slope).powi(2), 0.0, 0.0)
    };
    let largest = |side: usize| {
        let changes = changes_of(&square(side, parabola), Rate);
        let inner = (1..side - 1).map(|col| {
            let x = col as f64 / (side - 1) as f64;
            error(changes[5 * side + col].gamma, exact(x))
        });
        inner.fold(0.0, f64::max)
    };
    let [coarse, fine] = [51, 101].map(largest);
    assert!(fine < 1e-3 && (coarse / fine).log2() > 1.9, "{coarse:e} {fine:e}");
}

#[test]
fn the_rate_does_not_depend_on_how_the_grid_is_laid_but_the_literal_form_does() {
    let at = DVec2::new(0.4, 0.3);
    let invariants = |form: DifferenceForm, steps: [DVec2; 2]| {
        let surface =
            Formula { origin: at - 2.0 * steps[0] - 2.0 * steps[1], steps, ..square(5, hills) };
        let gamma = changes_of(&surface, form)[2 * 5 + 2].gamma;
        [gamma.xx + gamma.yy, gamma.det()]
    };
    let h = 1e-3;
    let straight = [DVec2::X * h, DVec2::Y * h];
    let oblique = [DVec2::new(1.0, 0.9) * h, DVec2::new(-0.5, 2.0) * h];
    for (a, b) in invariants(Rate, straight).into_iter().zip(invariants(Rate, oblique)) {
        assert!((a - b).abs() < 1e-4 * a.abs(), "{a} {b}");
    }
    // On the diagonal of a trough the paper's form no longer sees that nothing changes along it.
    let diagonal = [DVec2::new(h, h), DVec2::new(h, -h)];
    let trough = |form, steps| {
        let surface = Formula { origin: at, steps, ..square(5, parabola) };
        let gamma = changes_of(&surface, form)[2 * 5 + 2].gamma;
        gamma.det() / (gamma.xx + gamma.yy).powi(2)
    };
    assert!(trough(Rate, diagonal) < 1e-6 && trough(Literal, straight) < 1e-12);
    assert!(trough(Literal, diagonal) > 0.01);
}

#[test]
fn differences_to_the_neighbours_are_chords_of_the_tensor() {
    let side = 41;
    let ring = Formula {
        counts: [side, 7],
        steps: [DVec2::X * 4.0 / side as f64, DVec2::Y * 0.1],
        periodic: [true, false],
        ..square(side, cylinder)
    };
    let control = Control::default();
    let differences =
        at_nodes(&ring, 0.25, &control, |around| [0, 1, 2, 3].map(|k| around.difference(k)));
    // ttᵀ, turned by the angle θ, is √2 sin θ away.
    let angle = 2.0 * PI / side as f64;
    let chord = SQRT_2 * angle.sin() / 0.75;
    for (l, row) in differences.unwrap().iter().zip((0..).map(|i| i / side)) {
        assert!((l[0] - chord).abs() < 1e-12 && (l[1] - chord).abs() < 1e-12, "{l:?}");
        assert!(if row < 6 { l[2] < 1e-12 } else { l[2].is_nan() });
        assert!(if row > 0 { l[3] < 1e-12 } else { l[3].is_nan() });
    }
}

#[test]
fn missing_neighbours_are_left_out() {
    let voids = |col: usize, row: usize| (10..=20).contains(&col) && (10..=20).contains(&row);
    let side = 31;
    for form in [Rate, Literal] {
        let whole = changes_of(&square(side, hills), form);
        let holed = changes_of(&Formula { voids, ..square(side, hills) }, form);
        let most = whole.iter().map(|c| c.gamma.xx + c.gamma.yy).fold(0.0, f64::max);
        for (i, (a, b)) in whole.iter().zip(&holed).enumerate() {
            let (col, row) = (i % side, i / side);
            let e = error(a.gamma, b.gamma);
            assert!(voids(col, row) || e < 0.1 * most, "{form:?} {col} {row}: {e} {most}");
        }
        // No faster at the border than next to it.
        for col in 1..side - 1 {
            let e = error(whole[col].gamma, whole[side + col].gamma);
            assert!(e < 0.1 * most, "{form:?} {col}: {e} {most}");
        }
    }
    let island = Formula { voids: |col, row| col + row != 3, ..square(5, hills) };
    for change in changes_of(&island, Rate).iter().skip(3).step_by(4) {
        assert!(change.gamma.xx.is_finite() && change.area > 0.0);
    }
}

#[test]
fn threads_change_no_bit() {
    let tensors = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let field = |surface: &dyn Surface| {
            let metric = Difference::default()
                .on(surface, &Modifiers::default(), &Control::default())
                .unwrap();
            let at = |i: usize| metric.speed(DVec2::new((i % 77) as f64, (i / 77) as f64));
            (0..77 * 77).map(|i| at(i).unwrap()).collect::<Vec<_>>()
        };
        pool.install(|| field(&square(77, hills)))
    };
    let one = tensors(1);
    assert!([2, 5].into_iter().all(|threads| tensors(threads) == one));
}

fn fitted(scale: f64, z: impl Fn(f64, f64) -> f64) -> HeightSurface {
    let step = DVec2::splat(30.0 * scale);
    let frame = GridFrame::new(41, 31, DVec2::ZERO, step, Ground::METRES).unwrap();
    let node = |i: usize| ((i % 41) as f64, (i / 41) as f64);
    let heights = (0..41 * 31).map(|i| scale * z(node(i).0, node(i).1)).collect();
    let terrain = Terrain::new(frame, heights, Crs::none()).unwrap();
    let options = FitOptions { smoothing: Smoothing::Interpolate, ..FitOptions::default() };
    HeightSurface::fit(&terrain, &options, &Control::default()).unwrap()
}

#[test]
fn a_uniform_scale_scales_the_tensor() {
    let speeds = |form: DifferenceForm, scale: f64| -> Vec<Sym2> {
        let surface =
            fitted(scale, |x, y| 90.0 * (0.3 * x).sin() + 60.0 * (0.2 * y + 0.1 * x).cos());
        let metric = Difference { form, ..Difference::default() };
        let field = metric.on(&surface, &Modifiers::default(), &Control::default()).unwrap();
        assert!(
            field.parameter("difference_delta").unwrap() > 0.0
                && field.parameter("delta_per_m").unwrap() > 0.0
        );
        (0..41)
            .map(|i| field.speed(DVec2::new(f64::from(i), 0.7 * f64::from(i))).unwrap())
            .collect()
    };
    for (form, power) in [(Rate, 0), (Literal, -2)] {
        for (a, b) in speeds(form, 1.0).into_iter().zip(speeds(form, 7.0)) {
            let wanted = a * 7f64.powi(power);
            assert!(error(b, wanted) < 1e-6 * (wanted.xx + wanted.yy), "{form:?}");
        }
    }
}

#[test]
fn on_a_plane_the_metric_is_isotropic() {
    let surface = fitted(1.0, |x, y| 3.0 * x - 7.0 * y + 500.0);
    for form in [Rate, Literal] {
        let metric = Difference { form, ..Difference::default() };
        let field = metric.on(&surface, &Modifiers::default(), &Control::default()).unwrap();
        let geodesic = Isotropic.on(&surface, &Modifiers::default(), &Control::default()).unwrap();
        let at = DVec2::new(3.4, 17.0);
        let delta = field.parameter("difference_delta").unwrap();
        assert!(
            error(field.speed(at).unwrap() * delta, geodesic.speed(at).unwrap()) < 1e-6,
            "{form:?}"
        );
    }
}

#[test]
fn binding_can_be_cancelled() {
    let cancelled = |control: &Control| {
        let (metric, surface) = (Difference::default(), square(150, hills));
        let in_space = metric.on(&surface, &Modifiers::default(), control);
        assert!(matches!(in_space, Err(Error::Cancelled)));
        let surface = fitted(1.0, |x, y| x * y);
        let on_ground = metric.on(&surface, &Modifiers::default(), control);
        assert!(matches!(on_ground, Err(Error::Cancelled)));
    };
    let control = Control::default();
    control.cancel.cancel();
    cancelled(&control);
    // In the middle.
    let cancel = CancelToken::default();
    let asked = cancel.clone();
    let progress = move |_: &str, done: f64| {
        assert!((0.0..1.0).contains(&done));
        asked.cancel();
    };
    cancelled(&Control { cancel, progress: Some(Arc::new(progress)) });
}

#[test]
fn offsets_out_of_range_are_refused() {
    let surface = fitted(1.0, |x, _| x * x);
    let none = Modifiers::default();
    for bad in [Delta::Auto(0.0), Delta::Absolute(f64::NAN), Delta::Absolute(-1.0)] {
        let default = Difference::default();
        let own = Difference { delta: bad, ..default };
        let inner = Difference { curvature_delta: bad, ..default };
        assert!(
            own.on(&surface, &none, &Control::default()).is_err()
                && inner.on(&surface, &none, &Control::default()).is_err()
        );
    }
}
