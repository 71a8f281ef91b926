//! Figure 7 of Seong, Jeong and Cohen (2008): signatures of the parts of several surfaces.
//!
//! `cargo run --release --example figure_7 [FOLDER]` prints λ of each part and how well like parts are distinguished from others, and
//! draws λ1 and λ2 into FOLDER or `target/figures`.

#[path = "figures/output.rs"]
mod output;
#[allow(dead_code, reason = "figure 9 uses the rest")]
#[path = "figures/parts.rs"]
mod parts;
#[path = "figures/shapes.rs"]
mod shapes;

use glam::DVec2;
use ridgeway::render::{LogPlot, Mark, pair_colour};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let points = parts::points()?;
    println!("{:<14} {:>8}  signature", "part", "size, m");
    for point in &points {
        let signature = point.signature;
        println!("{:<14} {:8.3}  {:.4?}", point.part, signature.size, signature.eigenvalues);
    }
    let [nearest, silhouette] = parts::separation(&points);
    println!("the nearest is of the same part: {nearest:.2}; mean silhouette: {silhouette:.2}");

    let mut names: Vec<&str> = Vec::new();
    let mut plot = LogPlot {
        kinds: vec!["first surface".into(), "other size, section, parameters".into()],
        axes: ["λ1".into(), "λ2".into()],
        title: "Signatures of like parts".into(),
        ..LogPlot::default()
    };
    for point in &points {
        let is_new = !names.contains(&point.part);
        if is_new {
            names.push(point.part);
        }
        let [x, y, ..] = point.signature.eigenvalues;
        plot.marks.push(Mark {
            at: DVec2::new(x, y),
            colour: pair_colour(names.iter().position(|name| *name == point.part)),
            kind: usize::from(point.second),
            label: if is_new { point.part.into() } else { String::new() },
        });
    }
    output::save("figure-7.png", &plot.png()?)?;
    Ok(())
}
