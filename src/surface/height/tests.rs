//! Fits against closed forms.

use std::f64::consts::TAU;

use super::*;
use crate::grid::Ground;

const DEGREES: [Degree; 2] = [Degree::Cubic, Degree::Quintic];

/// Cells of 1 m by 1 m.
fn unit_frame(cols: usize, rows: usize) -> GridFrame {
    GridFrame::new(cols, rows, DVec2::ZERO, DVec2::ONE, Ground::METRES).unwrap()
}

/// Samples `z(column, row)`.
fn sample(frame: &GridFrame, z: impl Fn(f64, f64) -> f64) -> Vec<f64> {
    let (cols, rows) = (frame.cols(), frame.rows());
    (0..cols * rows).map(|i| z((i % cols) as f64, (i / cols) as f64)).collect()
}

fn fit(frame: &GridFrame, heights: &[f64], degree: Degree, smoothing: Smoothing) -> HeightSurface {
    let options = FitOptions { degree, smoothing };
    HeightSurface::fit_heights(frame.clone(), heights, &options, &Control::default()).unwrap()
}

fn fit_row(heights: &[f64], smoothing: Smoothing) -> HeightSurface {
    fit(&unit_frame(heights.len(), 1), heights, Degree::Cubic, smoothing)
}

/// Uniform noise in −0.5 … 0.5 (Knuth's 64-bit generator).
fn noise(count: usize) -> Vec<f64> {
    let mut state = 1_u64;
    let mut next = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        (state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
    };
    (0..count).map(|_| next()).collect()
}

fn jets(surface: &HeightSurface) -> Vec<HeightJet> {
    let mut jets = vec![HeightJet::default(); surface.frame.nodes()];
    for (row, jets) in jets.chunks_mut(surface.frame.cols()).enumerate() {
        surface.row_jets(row, jets);
    }
    jets
}

fn largest_difference(a: &HeightJet, b: &HeightJet) -> f64 {
    let parts = |j: &HeightJet| [j.z, j.zx, j.zy, j.zxx, j.zxy, j.zyy];
    parts(a).iter().zip(parts(b)).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

#[test]
fn interpolation_reproduces_polynomials_of_its_degree_up_to_the_border() {
    for (degree, p) in [(Degree::Cubic, 3), (Degree::Quintic, 5)] {
        let frame =
            GridFrame::new(23, 17, DVec2::ZERO, DVec2::new(2.0, 5.0), Ground::METRES).unwrap();
        // z = (x/20)^p (y/40)^p with x east and y north: row = −y/5.
        let z = |x: f64, y: f64| (x / 20.0).powi(p) * (y / 40.0).powi(p);
        let heights = sample(&frame, |c, r| z(2.0 * c, -5.0 * r));
        let surface = fit(&frame, &heights, degree, Smoothing::Interpolate);
        assert!(surface.residuals().max < 1e-10, "{:?}", surface.residuals());
        let power = |t: f64, scale: f64, order: i32| -> f64 {
            let factor: i32 = (0..order).map(|i| p - i).product();
            f64::from(factor) * (t / scale).powi(p - order) / scale.powi(order)
        };
        for at in
            [DVec2::ZERO, DVec2::new(22.0, 16.0), DVec2::new(0.3, 15.9), DVec2::new(11.2, 7.7)]
        {
            let (x, y) = (2.0 * at.x, -5.0 * at.y);
            let d = |i: i32, j: i32| power(x, 20.0, i) * power(y, 40.0, j);
            let exact = HeightJet {
                z: d(0, 0),
                zx: d(1, 0),
                zy: d(0, 1),
                zxx: d(2, 0),
                zxy: d(1, 1),
                zyy: d(0, 2),
            };
            let difference = largest_difference(&surface.jet(at), &exact);
            assert!(difference < 1e-9, "{degree:?} at {at}: {difference:e}");
            let third = surface.third_derivatives(at);
            for (got, want) in third.into_iter().zip([d(3, 0), d(2, 1), d(1, 2), d(0, 3)]) {
                assert!((got - want).abs() < 1e-8, "{degree:?} at {at}: {third:?}");
            }
        }
    }
}

#[test]
fn interpolation_converges_with_full_order_in_the_interior_and_at_the_border() {
    let exact = |x: f64, y: f64| HeightJet {
        z: (3.0 * x).sin() * (2.0 * y).cos(),
        zx: 3.0 * (3.0 * x).cos() * (2.0 * y).cos(),
        zy: -2.0 * (3.0 * x).sin() * (2.0 * y).sin(),
        zxx: -9.0 * (3.0 * x).sin() * (2.0 * y).cos(),
        zxy: -6.0 * (3.0 * x).cos() * (2.0 * y).sin(),
        zyy: -4.0 * (3.0 * x).sin() * (2.0 * y).cos(),
    };
    for (degree, p) in [(Degree::Cubic, 3), (Degree::Quintic, 5)] {
        for region in ["interior", "border"] {
            let errors: Vec<[f64; 3]> = [20, 40, 80, 160]
                .map(|n| {
                    let h = 1.0 / n as f64;
                    let frame =
                        GridFrame::new(n + 1, n + 1, DVec2::ZERO, DVec2::splat(h), Ground::METRES)
                            .unwrap();
                    let heights = sample(&frame, |c, r| exact(c * h, -r * h).z);
                    let surface = fit(&frame, &heights, degree, Smoothing::Interpolate);
                    let mut errors = [0.0_f64; 3];
                    for i in 0..=64 {
                        let s = i as f64 / 64.0;
                        let place = if region == "border" {
                            DVec2::new(0.37 * h, 0.1 + 0.8 * s)
                        } else {
                            DVec2::new(0.3 + 0.4 * s, 0.61 - 0.2 * s)
                        };
                        let (got, want) = (surface.jet(place / h), exact(place.x, -place.y));
                        let pairs = [
                            (got.z - want.z).abs(),
                            (got.zx - want.zx).abs().max((got.zy - want.zy).abs()),
                            (got.zxx - want.zxx)
                                .abs()
                                .max((got.zyy - want.zyy).abs())
                                .max((got.zxy - want.zxy).abs()),
                        ];
                        errors.iter_mut().zip(pairs).for_each(|(e, p)| *e = e.max(p));
                    }
                    errors
                })
                .to_vec();
            for order in 0..3 {
                let expected = f64::from(p + 1 - order);
                for pair in errors.windows(2) {
                    let (coarse, fine) = (pair[0][order as usize], pair[1][order as usize]);
                    let observed = (coarse / fine).log2();
                    assert!(
                        observed > expected - 0.4 || fine < 1e-11 * 160_f64.powi(order),
                        "{degree:?}, {region}, derivative {order}: {coarse:e} to {fine:e}"
                    );
                }
            }
        }
    }
}

#[test]
fn waves_of_the_cutoff_length_keep_half_their_amplitude() {
    for degree in DEGREES {
        for cells in [2.5, 4.0, 8.0, 16.0, 40.0, 123.4] {
            // Ten whole waves in the middle of thirty, whole numbers of nodes.
            let wave = (10.0 * cells) as usize;
            let heights: Vec<f64> = (0..3 * wave).map(|i| (TAU * i as f64 / cells).cos()).collect();
            let surface =
                fit(&unit_frame(3 * wave, 1), &heights, degree, Smoothing::CutoffCells(cells));
            let middle = wave..2 * wave;
            let product: f64 =
                middle.map(|i| surface.height(DVec2::new(i as f64, 0.0)) * heights[i]).sum();
            let response = 2.0 * product / wave as f64;
            assert!((response - 0.5).abs() < 0.002, "{degree:?}, {cells} cells: {response}");
            let column =
                fit(&unit_frame(1, heights.len()), &heights, degree, Smoothing::Cutoff(cells));
            for i in [0, wave, 2 * wave + 1] {
                let i = i as f64;
                let (a, b) =
                    (surface.height(DVec2::new(i, 0.0)), column.height(DVec2::new(0.0, i)));
                assert!((a - b).abs() < 1e-12);
            }
        }
    }
}

#[test]
fn smoothing_keeps_quadratics_for_any_cutoff() {
    let frame = unit_frame(40, 31);
    let z = |c: f64, r: f64| 3.0 + 0.4 * c - 0.1 * r + 0.01 * c * c - 0.02 * c * r + 0.03 * r * r;
    let heights = sample(&frame, z);
    for degree in DEGREES {
        for cells in [1e-6, 2.0, 16.0, 100.0, 1e4, 1e12] {
            let surface = fit(&frame, &heights, degree, Smoothing::CutoffCells(cells));
            for (col, row) in [(0, 0), (39, 0), (20, 15), (39, 30)] {
                let jet = surface.jet(DVec2::new(col as f64, row as f64));
                let (c, r) = (col as f64, row as f64);
                let exact = HeightJet {
                    z: z(c, r),
                    zx: 0.4 + 0.02 * c - 0.02 * r,
                    zy: 0.1 + 0.02 * c - 0.06 * r,
                    zxx: 0.02,
                    zxy: 0.02,
                    zyy: 0.06,
                };
                let difference = largest_difference(&jet, &exact);
                // The condition of the equations costs some digits at long cut-offs.
                let tolerance = if cells < 1e3 { 1e-8 } else { 1e-5 };
                assert!(difference < tolerance, "{degree:?}, {cells}: {difference:e}");
            }
        }
    }
}

#[test]
fn row_jets_are_the_jets_at_the_nodes() {
    for degree in DEGREES {
        for (cols, rows) in [(1, 1), (1, 9), (9, 1), (2, 2), (3, 5), (4, 4), (5, 6), (33, 20)] {
            let frame = unit_frame(cols, rows);
            let heights = sample(&frame, |c, r| (c * 0.9).sin() + (r * 0.4 + c * 0.3).cos());
            let every = [
                Smoothing::Interpolate,
                Smoothing::CutoffCells(5.0),
                Smoothing::CutoffCells(50.0),
                Smoothing::Tolerance(0.2),
                Smoothing::Auto,
            ];
            for smoothing in every {
                let surface = fit(&frame, &heights, degree, smoothing);
                for (i, jet) in jets(&surface).iter().enumerate() {
                    let at = DVec2::new((i % cols) as f64, (i / cols) as f64);
                    let difference = largest_difference(jet, &surface.jet(at));
                    assert!(difference < 1e-12, "{degree:?} {cols}×{rows} {smoothing:?}");
                    assert!((surface.height(at) - jet.z).abs() < 1e-12);
                    if smoothing == Smoothing::Interpolate {
                        assert!((jet.z - heights[i]).abs() < 1e-12);
                    }
                }
                assert!(surface.rms_curvature().is_finite());
            }
        }
    }
}

#[test]
fn small_grids_have_the_polynomial_of_their_nodes() {
    let frame = unit_frame(1, 1);
    let one = fit(&frame, &[7.0], Degree::Cubic, Smoothing::CutoffCells(16.0));
    assert_eq!(one.jet(DVec2::ZERO), HeightJet { z: 7.0, ..Default::default() });
    let line = fit_row(&[1.0, 3.0], Smoothing::Interpolate);
    let jet = line.jet(DVec2::new(0.5, 0.0));
    assert!((jet.z - 2.0).abs() < 1e-14 && (jet.zx - 2.0).abs() < 1e-14 && jet.zxx.abs() < 1e-13);
    let parabola = fit_row(&[0.0, 1.0, 4.0], Smoothing::Interpolate);
    assert!((parabola.jet(DVec2::new(1.3, 0.0)).zxx - 2.0).abs() < 1e-12);
}

#[test]
fn sphere_cap_and_cylinder_have_their_curvature() {
    let (radius, n) = (200.0_f64, 101);
    let frame = unit_frame(n, n);
    let from_middle = |t: f64| t - 50.0;
    let cap = sample(&frame, |c, r| {
        (radius * radius - from_middle(c).powi(2) - from_middle(r).powi(2)).sqrt()
    });
    let trough = sample(&frame, |c, _| -(radius * radius - from_middle(c).powi(2)).sqrt());
    for (degree, tolerance) in [(Degree::Cubic, 2e-4), (Degree::Quintic, 1e-6)] {
        for jet in jets(&fit(&frame, &cap, degree, Smoothing::Interpolate)) {
            let curvature = jet.curvature();
            for kappa in curvature.principal {
                assert!((kappa * radius + 1.0).abs() < tolerance, "{degree:?}: {kappa}");
            }
        }
        let surface = fit(&frame, &trough, degree, Smoothing::Interpolate);
        for jet in jets(&surface) {
            let [k1, k2] = jet.curvature().principal;
            assert!((k1 * radius - 1.0).abs() < tolerance && (k2 * radius).abs() < tolerance);
        }
        assert!((surface.rms_curvature() * radius - 0.5_f64.sqrt()).abs() < tolerance);
    }
}

#[test]
fn degrees_give_the_curvature_of_metres() {
    // One hill of 2 km on a degree grid at 60° N, sampled by its local metres.
    let step = DVec2::new(2.0 / 3600.0, 1.0 / 3600.0);
    let degrees = GridFrame::new(201, 201, DVec2::new(8.0, 60.0), step, Ground::WGS84).unwrap();
    let spacing = degrees.mid_spacing();
    let metres = GridFrame::new(201, 201, DVec2::ZERO, spacing, Ground::METRES).unwrap();
    let hill = |frame: &GridFrame, c: f64, r: f64| {
        let (x, y) = ((c - 100.0) * frame.spacing(r).x, (r - 100.0) * frame.spacing(r).y);
        500.0 * (-(x * x + y * y) / 2e6_f64).exp()
    };
    for smoothing in [Smoothing::Interpolate, Smoothing::Cutoff(400.0)] {
        let a =
            fit(&degrees, &sample(&degrees, |c, r| hill(&degrees, c, r)), Degree::Cubic, smoothing);
        let b =
            fit(&metres, &sample(&metres, |c, r| hill(&metres, c, r)), Degree::Cubic, smoothing);
        let scale = b.rms_curvature();
        assert!((a.rms_curvature() / scale - 1.0).abs() < 1e-3);
        let (a, b) = (jets(&a), jets(&b));
        for (a, b) in a.iter().zip(&b) {
            let [a, b] = [a, b].map(|jet| jet.curvature().principal);
            assert!(
                (a[0] - b[0]).abs() < 0.02 * scale && (a[1] - b[1]).abs() < 0.02 * scale,
                "{a:?} {b:?} {scale}"
            );
        }
    }
}

#[test]
fn threads_do_not_change_a_bit() {
    let frame =
        GridFrame::new(130, 90, DVec2::new(8.0, 47.0), DVec2::splat(1e-3), Ground::WGS84).unwrap();
    let mut heights = noise(frame.nodes());
    heights[40 * 130 + 20..40 * 130 + 60].fill(f64::NAN);
    for smoothing in [Smoothing::CutoffCells(9.0), Smoothing::Tolerance(0.2), Smoothing::Auto] {
        let run = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| {
                let surface = fit(&frame, &heights, Degree::Cubic, smoothing);
                (surface.fit.coefficients.clone(), surface.residuals(), surface.rms_curvature())
            })
        };
        assert_eq!(run(1), run(7));
    }
}

/// A 60 × 50 grid of `z` with a disc, a corner, a whole row and a whole column missing.
fn with_voids(frame: &GridFrame, z: impl Fn(f64, f64) -> f64) -> Vec<f64> {
    sample(frame, |c, r| {
        let disc = (c - 25.0).hypot(r - 20.0) < 6.0;
        let corner = c + r < 9.0;
        if disc || corner || r == 35.0 || c == 48.0 { f64::NAN } else { z(c, r) }
    })
}

#[test]
fn quadratics_with_voids_are_reproduced() {
    let frame = unit_frame(60, 50);
    let z = |c: f64, r: f64| 100.0 + 0.3 * c - 0.2 * r + 0.01 * c * c + 0.02 * c * r - 0.03 * r * r;
    for degree in DEGREES {
        for smoothing in
            [Smoothing::Interpolate, Smoothing::CutoffCells(16.0), Smoothing::Tolerance(1e-7)]
        {
            let surface = fit(&frame, &with_voids(&frame, z), degree, smoothing);
            assert!(surface.is_void(25, 20) && !surface.is_void(0, 20));
            for (i, jet) in jets(&surface).iter().enumerate() {
                if surface.is_void(i % 60, i / 60) {
                    continue;
                }
                let (c, r) = ((i % 60) as f64, (i / 60) as f64);
                let exact = HeightJet {
                    z: z(c, r),
                    zx: 0.3 + 0.02 * c + 0.02 * r,
                    zy: 0.2 - 0.02 * c + 0.06 * r,
                    zxx: 0.02,
                    zxy: -0.02,
                    zyy: -0.06,
                };
                let difference = largest_difference(jet, &exact);
                let tolerance = if let Smoothing::Tolerance(_) = smoothing { 1e-5 } else { 1e-8 };
                assert!(
                    difference < tolerance,
                    "{degree:?} {smoothing:?} ({c}, {r}): {difference:e}"
                );
            }
        }
    }
}

/// Ground of many shapes on 80 × 70 nodes: an island, a ragged coast, a bridge of three cells, a strip, pits and a bay; whether
/// each node is void.
fn shapes_of_voids() -> [(&'static str, Vec<bool>); 6] {
    let frame = unit_frame(80, 70);
    let pits = noise(frame.nodes());
    let coast = |r: f64| 35.0 + 14.0 * (r * 0.25).sin() + 3.0 * (r * 0.8).cos();
    let void_where = |is_void: &dyn Fn(f64, f64) -> bool| {
        sample(&frame, |c, r| f64::from(is_void(c, r))).into_iter().map(|v| v > 0.0).collect()
    };
    [
        ("island", void_where(&|c, r| (c - 40.0).hypot(r - 33.0) > 17.0)),
        ("coast", void_where(&|c, r| c > coast(r))),
        ("bridge", void_where(&|c, r| (c - 40.0).abs() < 15.0 && (r - 30.0).abs() > 1.5)),
        ("strip", void_where(&|c, r| (c - r).abs() > 12.0)),
        ("pits", void_where(&|c, r| pits[(r * 80.0 + c) as usize] > 0.3)),
        ("bay", void_where(&|c, r| c > 20.0 && (r - 35.0).abs() < 0.4 * (c - 20.0))),
    ]
}

#[test]
fn polynomials_are_continued_into_voids_of_any_shape() {
    let frame = unit_frame(80, 70);
    // Of longer cut-offs the continuation is kept near the heights, which bounds parabolas too.
    let every = [
        (Degree::Cubic, Smoothing::Interpolate, 3, 1e-9),
        // Of degree 5 the rounding of heights grows by as much where few are near, as at the tips of the coast.
        (Degree::Quintic, Smoothing::Interpolate, 5, 1e-4),
        (Degree::Cubic, Smoothing::CutoffCells(6.0), 2, 1e-9),
        (Degree::Quintic, Smoothing::CutoffCells(13.0), 2, 1e-9),
    ];
    for (degree, smoothing, p, most) in every {
        // z = x^p + x y^(p−1) − y², of x and y within ±1.
        let (x, y) = (|c: f64| (c - 40.0) / 40.0, |r: f64| (35.0 - r) / 40.0);
        let z = |c: f64, r: f64| x(c).powi(p) + x(c) * y(r).powi(p - 1) - y(r).powi(2);
        let whole = sample(&frame, z);
        let exact = jets(&fit(&frame, &whole, degree, Smoothing::Interpolate));
        for (shape, is_void) in shapes_of_voids() {
            // Of a bridge three cells wide only a parabola is known across it.
            if shape == "bridge" && p > 2 {
                continue;
            }
            let heights: Vec<f64> = whole
                .iter()
                .zip(&is_void)
                .map(|(&z, &void)| if void { f64::NAN } else { z })
                .collect();
            let surface = fit(&frame, &heights, degree, smoothing);
            let known = jets(&surface).into_iter().zip(&exact).zip(&is_void).filter(|(_, v)| !**v);
            let worst = known.map(|((a, b), _)| largest_difference(&a, b)).fold(0.0, f64::max);
            assert!(worst < most, "{shape} {degree:?} {smoothing:?}: {worst:e}");
        }
    }
}

#[test]
fn interpolation_converges_with_full_order_next_to_voids() {
    let exact = |x: f64, y: f64| HeightJet {
        z: (3.0 * x).sin() * (2.0 * y).cos(),
        zx: 3.0 * (3.0 * x).cos() * (2.0 * y).cos(),
        zy: -2.0 * (3.0 * x).sin() * (2.0 * y).sin(),
        zxx: -9.0 * (3.0 * x).sin() * (2.0 * y).cos(),
        zxy: -6.0 * (3.0 * x).cos() * (2.0 * y).sin(),
        zyy: -4.0 * (3.0 * x).sin() * (2.0 * y).cos(),
    };
    for (degree, p) in [(Degree::Cubic, 3), (Degree::Quintic, 5)] {
        // Around a round island: the mean errors within two cells of its coast.
        let errors = [60, 120, 240].map(|n| {
            let h = 1.0 / n as f64;
            let frame =
                GridFrame::new(n + 1, n + 1, DVec2::ZERO, DVec2::splat(h), Ground::METRES).unwrap();
            let off_middle = |c: f64, r: f64| (c * h - 0.5).hypot(r * h - 0.5);
            let heights = sample(&frame, |c, r| {
                if off_middle(c, r) > 0.4 { f64::NAN } else { exact(c * h, -r * h).z }
            });
            let surface = fit(&frame, &heights, degree, Smoothing::Interpolate);
            let (mut squares, mut count) = ([0.0_f64; 3], 0.0);
            for (i, got) in jets(&surface).into_iter().enumerate() {
                let (col, row) = (i % (n + 1), i / (n + 1));
                let (c, r) = (col as f64, row as f64);
                if surface.is_void(col, row) || off_middle(c, r) < 0.4 - 2.0 * h {
                    continue;
                }
                let want = exact(c * h, -r * h);
                let pairs = [
                    (got.z - want.z).abs(),
                    (got.zx - want.zx).abs().max((got.zy - want.zy).abs()),
                    (got.zxx - want.zxx).abs().max((got.zyy - want.zyy).abs()),
                ];
                squares.iter_mut().zip(pairs).for_each(|(sum, error)| *sum += error * error);
                count += 1.0;
            }
            squares.map(|sum| (sum / count).sqrt())
        });
        for order in 1..3 {
            for pair in errors.windows(2) {
                let (coarse, fine) = (pair[0][order], pair[1][order]);
                let observed = (coarse / fine).log2();
                let expected = (p + 1 - order) as f64;
                assert!(
                    observed > expected - 0.6 || fine < 1e-11 * 240_f64.powi(order as i32),
                    "{degree:?}, derivative {order}: {coarse:e} to {fine:e}"
                );
            }
        }
    }
}

#[test]
fn islands_are_fitted_as_if_alone() {
    let frame = unit_frame(90, 60);
    let rough = noise(frame.nodes());
    let terrain = sample(&frame, |c, r| 9.0 * (c * 0.2).sin() + rough[(r * 90.0 + c) as usize]);
    let only = |islands: &[[f64; 2]]| {
        let near = |c: f64, r: f64| islands.iter().any(|at| (c - at[0]).hypot(r - at[1]) < 12.0);
        let part = sample(&frame, |c, r| if near(c, r) { 0.0 } else { f64::NAN });
        part.iter().zip(&terrain).map(|(a, b)| a + b).collect::<Vec<_>>()
    };
    let (west, east) = ([20.0, 25.0], [65.0, 30.0]);
    for degree in DEGREES {
        for smoothing in
            [Smoothing::Interpolate, Smoothing::CutoffCells(6.0), Smoothing::CutoffCells(12.0)]
        {
            let both = fit(&frame, &only(&[west, east]), degree, smoothing);
            let both_jets = jets(&both);
            for island in [west, east] {
                let alone = fit(&frame, &only(&[island]), degree, smoothing);
                for (i, (a, b)) in jets(&alone).iter().zip(&both_jets).enumerate() {
                    let (col, row) = (i % 90, i / 90);
                    assert!(
                        alone.is_void(col, row) || a == b,
                        "{degree:?} {smoothing:?} {col} {row}"
                    );
                }
            }
        }
    }
}

#[test]
fn scattered_heights_are_met() {
    let frame = unit_frame(120, 90);
    let rough = noise(frame.nodes());
    let heights = sample(&frame, |c, r| {
        let i = (r * 120.0 + c) as usize;
        if i.is_multiple_of(61) || (r == 40.0 && c > 50.0) { 100.0 * rough[i] } else { f64::NAN }
    });
    for degree in DEGREES {
        let surface = fit(&frame, &heights, degree, Smoothing::Interpolate);
        assert!(surface.residuals().max < 1e-9, "{degree:?} {:?}", surface.residuals());
        let smooth = fit(&frame, &heights, degree, Smoothing::CutoffCells(6.0));
        assert!(smooth.residuals().max < 100.0 && smooth.rms_curvature() < 100.0);
    }
}

#[test]
fn far_from_heights_there_is_no_surface() {
    let frame = unit_frame(60, 60);
    let mut heights = vec![f64::NAN; 3600];
    heights[..5].fill(7.0);
    let surface = fit(&frame, &heights, Degree::Cubic, Smoothing::Interpolate);
    assert!((surface.height(DVec2::new(5.5, 0.9)) - 7.0).abs() < 1e-9);
    assert!(
        surface.height(DVec2::splat(30.0)).is_nan() && surface.jet(DVec2::splat(30.0)).zx.is_nan()
    );
}

#[test]
fn voids_hardly_disturb_the_heights_around_them() {
    let frame = unit_frame(60, 50);
    let rough = noise(frame.nodes());
    let z = |c: f64, r: f64| {
        20.0 * (c * 0.15).sin() * (r * 0.12).cos() + rough[(r * 60.0 + c) as usize]
    };
    let smoothing = Smoothing::CutoffCells(12.0);
    let whole = jets(&fit(&frame, &sample(&frame, z), Degree::Cubic, smoothing));
    let holed = fit(&frame, &with_voids(&frame, z), Degree::Cubic, smoothing);
    let (mut worst, mut curvature) = (0.0_f64, 0.0_f64);
    for (i, jet) in jets(&holed).iter().enumerate() {
        if !holed.is_void(i % 60, i / 60) {
            worst = worst.max((jet.z - whole[i].z).abs());
            curvature =
                curvature.max((jet.zxx - whole[i].zxx).abs().max((jet.zyy - whole[i].zyy).abs()));
        }
    }
    // Amplitude 20 m, curvature 0.45 /m, noise of 0.29 m.
    assert!(worst < 0.5 && curvature < 0.2, "{worst} {curvature}");
}

#[test]
fn wide_voids_stay_within_bounds() {
    // Half of the grid missing, on the side where elimination begins and on the other.
    let frame = unit_frame(1500, 9);
    let truth = sample(&frame, |c, r| 100.0 * (c * 0.05).sin() + r);
    for missing in [0.0..900.0, 600.0..1500.0, 200.0..1400.0] {
        let heights: Vec<f64> = (0..truth.len())
            .map(|i| if missing.contains(&((i % 1500) as f64)) { f64::NAN } else { truth[i] })
            .collect();
        for degree in DEGREES {
            for cells in [0.5, 2.0, 4.0, 7.0, 16.0, 64.0, 1e3, 1e9] {
                let surface = fit(&frame, &heights, degree, Smoothing::CutoffCells(cells));
                for jet in jets(&surface) {
                    assert!(jet.z.abs() < 400.0, "{degree:?} {cells} {missing:?} {jet:?}");
                }
                assert!(surface.residuals().rms < 110.0);
            }
            let surface = fit(&frame, &heights, degree, Smoothing::Interpolate);
            assert!(surface.residuals().max < 1e-9);
        }
    }
}

#[test]
fn a_single_height_makes_a_level_surface() {
    let frame = unit_frame(7, 5);
    let mut heights = vec![f64::NAN; 35];
    heights[16] = 42.0;
    for smoothing in [
        Smoothing::Interpolate,
        Smoothing::CutoffCells(16.0),
        Smoothing::Auto,
        Smoothing::Tolerance(1.0),
    ] {
        let surface = fit(&frame, &heights, Degree::Cubic, smoothing);
        for jet in jets(&surface) {
            assert!((jet.z - 42.0).abs() < 1e-6, "{smoothing:?} {jet:?}");
        }
    }
}

#[test]
fn cross_validation_finds_the_cutoff_that_removes_the_noise() {
    let frame = unit_frame(120, 100);
    let truth = sample(&frame, |c, r| 10.0 * (c * 0.08).sin() * (r * 0.06).cos());
    let heights: Vec<f64> =
        truth.iter().zip(noise(truth.len())).map(|(z, e)| z + 3.0 * e).collect();
    let error = |smoothing: Smoothing| {
        let surface = fit(&frame, &heights, Degree::Cubic, smoothing);
        let squares: f64 =
            jets(&surface).iter().zip(&truth).map(|(jet, z)| (jet.z - z).powi(2)).sum();
        ((squares / truth.len() as f64).sqrt(), surface.cutoff())
    };
    let (auto, cutoff) = error(Smoothing::Auto);
    let cutoff = cutoff.unwrap();
    // λ = (L/2π)⁶: a factor of ten either way.
    let tenfold = 10_f64.powf(1.0 / 6.0);
    assert!(auto < error(Smoothing::Cutoff(cutoff / tenfold)).0, "{cutoff}");
    assert!(auto < error(Smoothing::Cutoff(cutoff * tenfold)).0, "{cutoff}");
    assert!(auto < 0.25 * 3.0 / 12_f64.sqrt());
}

#[test]
fn a_tolerance_is_met_with_fewer_coefficients() {
    let frame = unit_frame(100, 60);
    let heights = sample(&frame, |c, r| 10.0 * (c * 0.1).sin() * (r * 0.08).cos());
    let mut before = 0;
    for tolerance in [1.0, 1e-1, 1e-2, 1e-3, 1e-13] {
        let surface = fit(&frame, &heights, Degree::Cubic, Smoothing::Tolerance(tolerance));
        assert!(surface.residuals().rms <= tolerance, "{:?}", surface.residuals());
        assert!(surface.coefficients() > before);
        before = surface.coefficients();
        if tolerance == 1e-2 {
            assert!(before < 600, "{before}");
        }
    }
}

#[test]
fn a_tolerance_is_met_on_oblong_cells() {
    let frame = GridFrame::new(60, 30, DVec2::ZERO, DVec2::new(1.0, 50.0), Ground::METRES).unwrap();
    let surface = fit(&frame, &noise(1800), Degree::Cubic, Smoothing::Tolerance(1e-6));
    assert!(surface.residuals().rms <= 1e-6, "{:?}", surface.residuals());
}

#[test]
fn impossible_wishes_are_refused() {
    let frame = unit_frame(4, 4);
    let fit = |heights: &[f64], smoothing| {
        let options = FitOptions { smoothing, ..Default::default() };
        HeightSurface::fit_heights(frame.clone(), heights, &options, &Control::default())
    };
    for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        for smoothing in
            [Smoothing::Cutoff(bad), Smoothing::CutoffCells(bad), Smoothing::Tolerance(bad)]
        {
            assert!(matches!(fit(&[0.0; 16], smoothing), Err(Error::Argument(_))));
        }
    }
    assert!(matches!(fit(&[f64::NAN; 16], Smoothing::Interpolate), Err(Error::Argument(_))));
    let control = Control::default();
    control.cancel.cancel();
    let cancelled =
        HeightSurface::fit_heights(frame.clone(), &[0.0; 16], &FitOptions::default(), &control);
    assert!(matches!(cancelled, Err(Error::Cancelled)));
}

#[test]
fn around_the_earth_no_meridian_is_special() {
    // Heights turned by some columns give the surface turned by as many, also at the seam and with a void there.
    let frame = |west: f64| {
        let origin = DVec2::new(west, 40.0);
        GridFrame::new(72, 12, origin, DVec2::splat(5.0), Ground::WGS84).unwrap()
    };
    let turned = 29;
    let mut heights: Vec<f64> = noise(72 * 12).iter().map(|z| 1e3 * z).collect();
    heights[5 * 72] = f64::NAN;
    let others: Vec<f64> =
        heights.chunks(72).flat_map(|row| [&row[turned..], &row[..turned]].concat()).collect();
    for smoothing in [Smoothing::Interpolate, Smoothing::CutoffCells(6.0)] {
        let surface = fit(&frame(-180.0), &heights, Degree::Cubic, smoothing);
        let other = fit(&frame(-180.0 + 5.0 * turned as f64), &others, Degree::Cubic, smoothing);
        assert_eq!(Surface::periodic(&surface), [true, false]);
        let of_rows = [jets(&surface), jets(&other)];
        for (i, a) in of_rows[0].iter().enumerate() {
            let (col, row) = (i % 72, i / 72);
            let b = of_rows[1][row * 72 + (col + 72 - turned) % 72];
            assert!(
                (a.z - b.z).abs() < 1e-3 && (a.zx - b.zx).abs() < 1e-8,
                "{col} {row}: {a:?} {b:?}"
            );
            let by_turn = surface.jet(DVec2::new(col as f64 + 72.0, row as f64));
            assert!((a.z - by_turn.z).abs() < 1e-9);
        }
        let (before, after) = (DVec2::new(71.4999, 3.0), DVec2::new(-0.5001, 3.0));
        assert!((surface.height(before) - surface.height(after)).abs() < 1e-6);
        assert!((surface.residuals().rms - other.residuals().rms).abs() < 1e-3);
        assert!(surface.frame().contains(surface.residuals().at));
    }
}
