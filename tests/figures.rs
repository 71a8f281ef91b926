//! The figures of Seong, Jeong and Cohen (2008): what each of them claims.

#[path = "../examples/figures/parametrisations.rs"]
mod parametrisations;
#[path = "../examples/figures/shapes.rs"]
mod shapes;

mod figure_5 {
    use ridgeway::{Delta, Metric};

    use crate::parametrisations;

    /// Distances do not depend on the parameters: they differ by the error of the solver, which falls with refinement.
    #[test]
    fn distances_agree_under_a_moebius_map() {
        for metric in [Metric::Isotropic, Metric::Curvature(Delta::default())] {
            let [coarse, middle, fine] = [50, 100, 200]
                .map(|n| parametrisations::compare(&metric, n).unwrap().mean_difference);
            let order = (coarse / fine).log2() / 2.0;
            println!("{metric:?}: {coarse:.2e} {middle:.2e} {fine:.2e}, order {order:.2}");
            assert!(order > 0.8 && fine < 2e-3, "{metric:?}");
        }
    }
}
