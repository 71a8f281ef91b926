//! The figures of Seong, Jeong and Cohen (2008): what each of them claims.

#[path = "../examples/figures/half_cylinders.rs"]
mod half_cylinders;
#[path = "../examples/figures/parametrisations.rs"]
mod parametrisations;
#[path = "../examples/figures/shapes.rs"]
mod shapes;

mod figure_5 {
    use glam::DVec2;
    use ridgeway::{Delta, Metric, ParametricSurface};

    use crate::parametrisations;

    /// Distances do not depend on the parameters: they differ by the error of the solver, which falls with refinement.
    #[test]
    fn distances_agree_under_a_moebius_map() {
        for metric in [Metric::Isotropic, Metric::Curvature(Delta::default())] {
            let compared = [50, 100, 200].map(|n| parametrisations::compare(&metric, n).unwrap());
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
        let compared = parametrisations::compare(&Metric::Isotropic, 50).unwrap();
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
    use ridgeway::metric::Difference;
    use ridgeway::{Delta, Metric};

    use crate::half_cylinders::{HalfCylinders, divide};

    /// From the same two seeds the border of the curvature tensor is not the seam, that of the difference tensor is.
    #[test]
    fn the_difference_tensor_finds_the_seam() {
        for nodes in [50, 100, 200] {
            let surface = HalfCylinders { nodes };
            let right = |metric| divide(&surface, &metric).unwrap().1;
            let curvature = right(Metric::Curvature(Delta::default()));
            let difference = right(Metric::Difference(Difference::default()));
            println!("{nodes}: {curvature:.4} {difference:.4}");
            assert!(curvature < 0.95, "{nodes}: {curvature}");
            // Within a column.
            assert!(difference >= 1.0 - 1.0 / nodes as f64, "{nodes}: {difference}");
        }
    }
}
