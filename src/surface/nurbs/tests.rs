use super::*;
use crate::surface::Surface;

/// A half circle of radius 2 about the origin from the top of the z axis to its bottom.
fn meridian() -> NurbsCurve {
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let points = [
        DVec4::new(0.0, 0.0, 2.0, 1.0),
        DVec4::new(2.0, 0.0, 2.0, half),
        DVec4::new(2.0, 0.0, 0.0, 1.0),
        DVec4::new(2.0, 0.0, -2.0, half),
        DVec4::new(0.0, 0.0, -2.0, 1.0),
    ];
    let knots = Knots::clamped_at(2, [0.5, 0.5].into_iter()).unwrap();
    NurbsCurve::new(knots, false, &points).unwrap()
}

fn sphere() -> NurbsSurface {
    NurbsSurface::revolve(&meridian(), DVec3::ZERO, DVec3::Z).unwrap()
}

/// A surface without any symmetry.
fn wavy() -> NurbsSurface {
    let knots = [
        Knots::new(3, vec![-1.0, 0.0, 0.0, 0.0, 0.4, 1.0, 1.0, 1.5, 2.0]).unwrap(),
        Knots::clamped(2, 4).unwrap(),
    ];
    let points: Vec<DVec4> = (0..20)
        .map(|k| {
            let (x, y) = (f64::from(k % 5), f64::from(k / 5));
            DVec4::new(x + 0.1 * y, y - 0.2 * x, (1.3 * x + y).sin(), 1.0 + 0.5 * (x * y).cos())
        })
        .collect();
    NurbsSurface::new(knots, [false; 2], &points).unwrap()
}

fn places(surface: &NurbsSurface) -> impl Iterator<Item = DVec2> + '_ {
    let share = |axis: usize, s: f64| {
        let [from, to] = surface.knots[axis].domain();
        from + s * (to - from)
    };
    (0..63).map(move |k| {
        DVec2::new(
            share(0, (f64::from(k % 9) + 0.4) / 9.0),
            share(1, (f64::from(k / 9) + 0.3) / 7.0),
        )
    })
}

/// Largest difference of two jets.
fn apart(a: &SurfaceJet, b: &SurfaceJet) -> f64 {
    let first = (0..2).map(|i| a.first[i].distance(b.first[i]));
    let second = (0..3).map(|i| a.second[i].distance(b.second[i]));
    first.chain(second).fold(a.point.distance(b.point), f64::max)
}

#[test]
fn derivatives_are_slopes() {
    let surface = wavy();
    let step = 1e-4;
    for u in places(&surface) {
        let jet = surface.jet(u);
        let slope = |by: DVec2, of: &dyn Fn(&SurfaceJet) -> DVec3| {
            (of(&surface.jet(u + by)) - of(&surface.jet(u - by))) / (2.0 * step)
        };
        let [x, y] = [step * DVec2::X, step * DVec2::Y];
        let slopes = SurfaceJet {
            point: jet.point,
            first: [slope(x, &|jet| jet.point), slope(y, &|jet| jet.point)],
            second: [
                slope(x, &|jet| jet.first[0]),
                slope(y, &|jet| jet.first[0]),
                slope(y, &|jet| jet.first[1]),
            ],
        };
        assert!(apart(&jet, &slopes) < 1e-5, "{u}: {}", apart(&jet, &slopes));
    }
}

#[test]
fn a_sphere_is_round_and_bends_alike() {
    let sphere = sphere();
    for u in places(&sphere) {
        let jet = sphere.jet(u);
        assert!((jet.point.length() - 2.0).abs() < 1e-13);
        assert!(jet.normal().distance(jet.point / 2.0) < 1e-12);
        // B = κ G with κ = −1/2: it bends away from the outward normal.
        let difference = jet.second_form() + jet.first_form() * 0.5;
        let scale = jet.first_form().xx + jet.first_form().yy;
        assert!((difference.xx.abs() + difference.xy.abs() + difference.yy.abs()) < 1e-10 * scale);
    }
}

#[test]
fn knots_change_no_point() {
    for surface in [wavy(), sphere()] {
        let mut finer = surface.clone();
        for (direction, u) in [(0, 0.3), (1, 0.7), (1, 0.7), (0, 0.9)] {
            finer = finer.with_knot(direction, u).unwrap();
        }
        assert_eq!(
            finer.net.len(),
            (surface.knots[0].controls() + 2) * (surface.knots[1].controls() + 2)
        );
        for u in places(&surface) {
            assert!(apart(&finer.jet(u), &surface.jet(u)) < 1e-11);
        }
    }
}

#[test]
fn reweighting_moves_points_along_the_surface_only() {
    for (surface, direction) in [(wavy(), 1), (sphere(), 1), (sphere(), 0)] {
        for ratio in [0.3, 1.0, 2.5] {
            let again = surface.reweighted(direction, ratio).unwrap();
            let [from, to] = surface.knots[direction].domain();
            for u in places(&surface) {
                let mut v = u;
                let s = (u[direction] - from) / (to - from);
                v[direction] = from + (to - from) * ratio * s / (1.0 + (ratio - 1.0) * s);
                let (a, b) = (surface.jet(u), again.jet(v));
                assert!(a.point.distance(b.point) < 1e-12);
                assert!(a.normal().distance(b.normal()) < 1e-11);
            }
            NurbsSurface::from_net(again.knots, again.closed, again.net).unwrap();
        }
    }
    // Unclamped knots reach beyond the domain, where a strong map has its pole.
    assert!(wavy().reweighted(0, 0.1).is_err());
    wavy().reweighted(0, 0.9).unwrap();
    assert!(sphere().reweighted(1, 1e-9).is_err());
}

#[test]
fn rows_are_made_of_jets_and_closed_directions_go_round() {
    let grid = sphere().on_grid(24, 13).unwrap();
    assert_eq!(grid.periodic(), [true, false]);
    for row in 0..13 {
        for (col, jet) in grid.row_space_jets(row).into_iter().enumerate() {
            let at = DVec2::new(col as f64, row as f64);
            assert!(apart(&jet, &grid.space_jet(at)) < 1e-13);
            assert!(apart(&jet, &grid.space_jet(at - DVec2::new(48.0, 0.0))) < 1e-12);
            assert!(jet.is_regular());
        }
    }
    assert!(grid.space_jet(DVec2::new(5.0, 0.0)).point.distance(2.0 * DVec3::Z) < 0.01);
    assert_eq!(grid.to_grid(DVec2::new(0.5, 1.0)), DVec2::new(12.0, 12.0));
    for (cols, rows) in [(2, 9), (9, 1), (0, 0), (usize::MAX, 9)] {
        assert!(sphere().on_grid(cols, rows).is_err());
    }
}

#[test]
fn periodic_knots_close_a_surface_smoothly() {
    // Uniform cubic splines whose last three columns are the first three again.
    let knots =
        [Knots::new(3, (0..14).map(f64::from).collect()).unwrap(), Knots::clamped(1, 2).unwrap()];
    let points: Vec<DVec4> = (0..20)
        .map(|k| {
            let angle = f64::from(k % 10 % 7) * std::f64::consts::TAU / 7.0;
            DVec4::new(angle.cos(), angle.sin(), f64::from(k / 10), 1.0)
        })
        .collect();
    let tube = NurbsSurface::new(knots, [true, false], &points).unwrap();
    let (before, after) = (tube.jet(DVec2::new(3.0 - 1e-9, 0.5)), tube.jet(DVec2::new(10.0, 0.5)));
    assert!(apart(&before, &after) < 1e-8);
}

#[test]
fn lofts_go_through_their_sections() {
    let ring = |z: f64, r: f64| {
        let centre = DVec3::new(0.2 * z, 0.0, z);
        NurbsCurve::ellipse(centre, r * DVec3::X, r * DVec3::Y).unwrap()
    };
    let mut sections: Vec<_> =
        [1.0, 1.5, 0.8, 1.1].iter().zip(0..).map(|(&r, k)| ring(f64::from(k), r)).collect();
    sections[2] = sections[2].with_knot(0.4).unwrap();
    let loft = NurbsSurface::loft(&sections, 3).unwrap();
    assert_eq!(loft.closed(), [true, false]);
    for u in [0.0, 0.1, 0.33, 0.7] {
        for (section, v) in [(&sections[0], 0.0), (&sections[3], 1.0)] {
            assert!(loft.jet(DVec2::new(u, v)).point.distance(section.point(u)) < 1e-12);
        }
    }
    let ruled = NurbsSurface::ruled(&sections[0], &sections[2]).unwrap();
    let middle = sections[0].point(0.3).midpoint(sections[2].point(0.3));
    assert!(ruled.jet(DVec2::new(0.3, 0.5)).point.distance(middle) < 1e-12);

    let line = NurbsCurve::polyline(&[DVec3::ZERO, DVec3::X]).unwrap();
    assert!(NurbsSurface::ruled(&line, &sections[0]).is_err());
    assert!(NurbsSurface::loft(&sections[..1], 1).is_err());
    assert!(NurbsSurface::loft(&[], 1).is_err());
    assert!(NurbsSurface::loft(&[line.clone(), line], 1).is_err());
}

#[test]
fn sweeps_keep_their_section_and_do_not_twist() {
    // A circle carried round a quarter circle is a part of a torus.
    let section = NurbsCurve::ellipse(DVec3::ZERO, 0.5 * DVec3::X, 0.5 * DVec3::Y).unwrap();
    let arc: Vec<DVec3> =
        (0..20).map(|k| DVec2::from_angle(1.5 * f64::from(k) / 19.0).extend(0.0) * 3.0).collect();
    let trajectory = NurbsCurve::through(&arc, 3).unwrap();
    let tube = NurbsSurface::sweep(&section, &trajectory, DVec3::Z, 40).unwrap();
    for u in places(&tube) {
        let jet = tube.jet(u);
        let spine = jet.point.with_z(0.0).normalize() * 3.0;
        assert!((jet.point.distance(spine) - 0.5).abs() < 1e-3, "{}", jet.point);
        assert!(jet.normal().distance((jet.point - spine) * 2.0) < 0.01);
        // The top of the section stays on top.
        let top = tube.jet(DVec2::new(0.25, u.y)).point;
        assert!((top.z - 0.5).abs() < 1e-5);
    }
    assert!(NurbsSurface::sweep(&section, &trajectory, trajectory.tangent(0.0), 40).is_err());
    assert!(NurbsSurface::sweep(&section, &trajectory, DVec3::Z, 3).is_err());
    assert!(NurbsSurface::sweep(&section, &trajectory, DVec3::Z, usize::MAX).is_err());
}

#[test]
fn areas_and_mean_curvatures_are_those_of_the_surface() {
    let measures = sphere().on_grid(100, 81).unwrap().measures();
    assert!((measures.area / (16.0 * std::f64::consts::PI) - 1.0).abs() < 1e-3);
    assert!((measures.rms_curvature - 0.5).abs() < 1e-9);
    // The tip of a cone has no bounds to its curvature, but no area either.
    let side = NurbsCurve::polyline(&[DVec3::Z, DVec3::X]).unwrap();
    let cone = NurbsSurface::revolve(&side, DVec3::ZERO, DVec3::Z).unwrap();
    let rms = |n| cone.clone().on_grid(n, n).unwrap().measures().rms_curvature;
    assert!(rms(200) < 1.15 * rms(100), "{} {}", rms(200), rms(100));
}
