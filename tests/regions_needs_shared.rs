//! Where the borders of regions fall on real terrain.

use std::path::Path;

use ridgeway::eikonal::TensorField;
use ridgeway::region::{SegmentOptions, Segmentation, gaussian_ranks};
use ridgeway::{
    Control, Curvature, FitOptions, HeightJet, HeightSurface, Isotropic, Metric, Modifiers, Terrain,
};

/// Mean over the nodes next to another region, and over the others, of the larger `|κ|`, 1/m.
fn mean_curvatures(surface: &HeightSurface, cut: &Segmentation) -> [f64; 2] {
    let (cols, labels) = (cut.cols, &cut.levels[0].labels);
    let mut sums = [(0.0, 0usize); 2];
    let mut jets = vec![HeightJet::default(); cols];
    for row in 1..cut.rows - 1 {
        surface.row_jets(row, &mut jets);
        for (col, jet) in jets.iter().enumerate().take(cols - 1).skip(1) {
            let node = row * cols + col;
            let around = [node - 1, node + 1, node - cols, node + cols].map(|i| labels[i]);
            if labels[node].is_none() || around.contains(&None) {
                continue;
            }
            let inside = usize::from(around.iter().all(|label| *label == labels[node]));
            let [k1, k2] = jet.curvature().principal;
            sums[inside].0 += k1.abs().max(k2.abs());
            sums[inside].1 += 1;
        }
    }
    sums.map(|(sum, count)| sum / count as f64)
}

/// A metric's borders bend more than the ground between them, and more so than those of geodesic regions.
#[test]
#[ignore = "needs ../shared"]
fn borders_fall_on_ridges_and_valleys() {
    for (dem, count) in [
        ("data/jacksboro.tif", 100),
        ("../shared/data/dem/andorra_utm31n_75m.tif", 100),
        ("../shared/data/dem/bigtujunga_srtm_utm11n_30m.tif", 100),
        ("../shared/data/dem/st_helens_utm10n_30m.tif", 100),
    ] {
        let control = Control::default();
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(dem);
        let terrain = Terrain::open(&path).unwrap();
        let surface = HeightSurface::fit(&terrain, &FitOptions::default(), &control).unwrap();
        let ranks = gaussian_ranks(&surface);
        let ratio = |metric: &dyn Metric| {
            let metric = metric.on(&surface, &Modifiers::default(), &Control::default()).unwrap();
            let field = TensorField::sample(&metric, &control).unwrap();
            // The radius that gives about so many regions, by bisection.
            let (mut low, mut high) = (0.0, f64::NAN);
            let mut options = SegmentOptions::default();
            loop {
                let cut = Segmentation::of(&field, &ranks, &options, &control).unwrap();
                let found = cut.levels[0].regions.len();
                if found.abs_diff(count) < count / 5 {
                    let [border, inside] = mean_curvatures(&surface, &cut);
                    println!(
                        "{dem} {} {found} regions: {border:.3e} {inside:.3e} {:.3}",
                        metric.name(),
                        border / inside
                    );
                    return border / inside;
                }
                let epsilon = cut.levels[0].regions[0].epsilon;
                if found > count {
                    low = epsilon
                } else {
                    high = epsilon
                }
                let middle = if high.is_nan() { 2.0 * low } else { 0.5 * (low + high) };
                options.epsilons = vec![middle];
            }
        };
        let curvature = ratio(&Curvature::default());
        let geodesic = ratio(&Isotropic);
        assert!(curvature > 1.1 && curvature > 1.05 * geodesic, "{dem}: {curvature} {geodesic}");
    }
}
