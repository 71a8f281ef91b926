//! The figures of Seong, Jeong and Cohen (2008): what each of them claims.

#[path = "../examples/figures/face.rs"]
mod face;
#[allow(dead_code, reason = "the example uses the rest")]
#[path = "../examples/figure_6/four_bumps.rs"]
mod four_bumps;
#[path = "../examples/figures/half_cylinders.rs"]
mod half_cylinders;
#[path = "../examples/figures/parametrisations.rs"]
mod parametrisations;
#[allow(dead_code, reason = "the examples use the rest")]
#[path = "../examples/figures/parts.rs"]
mod parts;
#[path = "../examples/figures/shapes.rs"]
mod shapes;
#[allow(dead_code, reason = "the example uses the rest")]
#[path = "../examples/figure_3/waves.rs"]
mod waves;

mod figure_5 {
    use glam::DVec2;
    use ridgeway::{Curvature, Isotropic, Metric, Surface};

    use crate::parametrisations;

    /// Distances do not depend on the parameters: they differ by the error of the solver, which falls with refinement.
    #[test]
    fn distances_agree_under_a_moebius_map() {
        let metrics: [&dyn Metric; 2] = [&Isotropic, &Curvature::default()];
        for metric in metrics {
            let compared = [50, 100, 200].map(|n| parametrisations::compare(metric, n).unwrap());
            let [mean, greatest] = [
                compared.each_ref().map(|c| c.mean_difference),
                compared.each_ref().map(|c| c.greatest_difference),
            ];
            println!("{metric:?}: {mean:?} {greatest:?}");
            let order = |differences: [f64; 3]| (differences[0] / differences[2]).log2() / 2.0;
            assert!(order(mean) > 0.9 && mean[2] < 2e-3, "{metric:?}");
            assert!(order(greatest) > 0.8 && greatest[2] < 1e-2, "{metric:?}");
        }
    }

    /// The nodes are others: no row of one is a row of the other but at the ends.
    #[test]
    fn the_nodes_of_the_knights_differ() {
        let compared = parametrisations::compare(&Isotropic, 50).unwrap();
        let height = |surface: usize, row: usize| {
            compared.surfaces[surface].space_jet(DVec2::new(0.0, row as f64)).point.z
        };
        assert!((height(0, 25) - height(1, 25)).abs() > 0.5);
        for map in &compared.maps {
            assert!(map.to_row_major().iter().all(|g| g.is_finite()));
        }
    }
}

mod figure_8 {
    use ridgeway::{Curvature, Difference, Metric};

    use crate::half_cylinders::{HalfCylinders, divide};

    /// From the same two seeds the border of the curvature tensor is not the seam, that of the difference tensor is.
    #[test]
    fn the_difference_tensor_finds_the_seam() {
        for nodes in [50, 100, 200] {
            let surface = HalfCylinders { nodes };
            let right = |metric: &dyn Metric| divide(&surface, metric).unwrap().1;
            let curvature = right(&Curvature::default());
            let difference = right(&Difference::default());
            println!("{nodes}: {curvature:.4} {difference:.4}");
            assert!(curvature < 0.95, "{nodes}: {curvature}");
            // Within a column.
            assert!(difference >= 1.0 - 1.0 / nodes as f64, "{nodes}: {difference}");
        }
    }
}

mod figure_3 {
    use ridgeway::region::{
        SegmentOptions, Segmentation, cluster, gaussian_ranks, region_statistics,
    };

    use super::waves::{SIDE, field, surface, terrain};

    #[test]
    fn a_cluster_of_flat_ground_is_larger() {
        let surface = surface(&terrain().unwrap()).unwrap();
        let field = field(&surface).unwrap();
        let size = |col| cluster(&field, [col, SIDE / 2], 12.0, &Default::default()).unwrap().len();
        let (flat, curved) = (size(SIDE / 4), size(3 * SIDE / 4));
        assert!(
            flat > 4 * curved && curved > 20,
            "{flat} nodes of flat ground, {curved} of curved"
        );
    }

    #[test]
    fn regions_of_one_radius_adapt_to_the_curvature() {
        let surface = surface(&terrain().unwrap()).unwrap();
        let options = SegmentOptions { epsilons: vec![12.0], ..SegmentOptions::default() };
        let cut = Segmentation::of(
            &field(&surface).unwrap(),
            &gaussian_ranks(&surface),
            &options,
            &Default::default(),
        )
        .unwrap();
        let measures = region_statistics(&surface, &cut.levels[0]);
        let mean_area = |curved: bool| {
            let bent = |m: f64| m > 1e-3;
            let areas = measures.iter().filter(|m| bent(m.mean_abs_curvature_per_m[0]) == curved);
            areas.clone().map(|m| m.area_m2).sum::<f64>() / areas.count() as f64
        };
        assert!(mean_area(false) > 2.0 * mean_area(true), "{measures:#?}");
    }
}

mod figure_6 {
    use super::four_bumps::{
        agreement, curvatures, marching_between_walls, segmentation, surface, terrain,
        total_curvature_watershed,
    };

    #[test]
    fn four_bumps_are_four_regions_whatever_the_order_of_the_seeds() {
        let surface = surface(&terrain().unwrap()).unwrap();
        for (seed, perturbation) in
            [0.0, 0.005, 0.01, 0.02].into_iter().cycle().take(16).enumerate()
        {
            let cut = segmentation(&surface, perturbation, seed as u64).unwrap();
            assert_eq!(cut.levels[0].regions.len(), 4, "{perturbation} {seed}");
            let agreement = agreement(&cut);
            assert!(agreement > 0.995, "{perturbation} {seed}: {agreement}");
        }
    }

    #[test]
    fn older_methods_find_nine_and_five() {
        let (gaussian, larger) = curvatures(&surface(&terrain().unwrap()).unwrap());
        assert_eq!(total_curvature_watershed(&gaussian), 9);
        assert_eq!(marching_between_walls(&larger), 5);
    }
}

mod figure_1 {
    use glam::DVec2;
    use ridgeway::Route;

    use crate::face;

    /// The curvature route costs less under its own metric and turns less; the isolines differ in shape.
    #[test]
    fn the_curvature_route_goes_where_the_face_is_smooth() {
        let terrain = face::face().unwrap();
        let comparison = face::routes(&terrain).unwrap();
        let [geodesic, curvature] = &comparison.routes[..] else { panic!("two routes") };
        assert!(comparison.costs[1][1] < 0.75 * comparison.costs[1][0]);
        assert!(comparison.costs[0][0] < 0.9 * comparison.costs[0][1]);
        let turn = |route: &Route| route.summary.total_normal_curvature_rad;
        assert!(turn(curvature) < 0.5 * turn(geodesic));
        // To the cheek below the eye and to the crown: about as far on the ground.
        let [isotropic, bent] = [0, 1].map(|metric| {
            let at = |x: f64, y: f64| {
                let at = terrain.frame().to_grid(DVec2::new(x, y));
                comparison.distances[metric].at(at).unwrap()
            };
            at(-20.0, 5.0) / at(5.0, 60.0)
        });
        assert!(bent > 1.2 * isotropic, "{bent} {isotropic}");
    }
}

mod figure_7 {
    use crate::parts;

    /// Like parts have like signatures: other size, section and parameters move them less than other parts lie away.
    #[test]
    fn like_parts_form_groups() {
        let [nearest, silhouette] = parts::separation(&parts::points().unwrap());
        assert!(nearest == 1.0 && silhouette > 0.7, "{nearest} {silhouette}");
    }

    #[test]
    fn parameters_do_not_matter() {
        let ([knight, twin], _) = parts::knights().unwrap();
        for (a, b) in knight.signatures.iter().zip(&twin.signatures) {
            assert!(a.distance(b) < 0.03, "{a:?} {b:?}");
        }
    }

    #[test]
    fn the_four_bumps_are_alike() {
        let bumps = parts::bumps().unwrap();
        assert_eq!(bumps.signatures.len(), 4);
        for other in &bumps.signatures[1..] {
            assert!(bumps.signatures[0].distance(other) < 0.03);
        }
    }
}

mod figure_9 {
    use ridgeway::region::match_regions;

    use crate::parts;

    /// Each part of a letter matches that part of a letter 1.7 times as large with another section.
    #[test]
    fn parts_of_letters_match() {
        let ([first, second], _) = parts::letters().unwrap();
        let found = match_regions(&first.signatures, &second.signatures, false).unwrap();
        assert_eq!(found.len(), 3);
        for pair in found {
            assert!(pair.first == pair.second && pair.mutual, "{pair:?}");
            assert!((pair.size_ratio / 1.7 - 1.0).abs() < 0.05, "{pair:?}");
        }
    }

    /// Of all parts the ant's tail and the bishop's head are the most alike, though one is 0.6 times as large.
    #[test]
    fn the_tail_of_an_ant_matches_a_part_of_a_bishop() {
        let ([ant, bishop], parts) = parts::pieces().unwrap();
        let found = match_regions(&ant.signatures, &bishop.signatures, false).unwrap();
        let best = found[0];
        assert_eq!([parts[0][best.first], parts[1][best.second]], ["tail"; 2]);
        assert!(best.mutual && best.distance < 0.07, "{best:?}");
        assert!((best.size_ratio / 0.6 - 1.0).abs() < 0.05, "{best:?}");
    }
}
