//! The figures of Seong, Jeong and Cohen (2008): what each of them claims.

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
