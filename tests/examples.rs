//! Every example runs and prints what it promises.

use std::process::Command;

/// Standard output of an example. Cargo builds the examples of a package along with its tests.
fn run(example: &str, args: &[&str]) -> String {
    let mut path = std::env::current_exe().expect("a test has a path");
    path.pop();
    path.pop();
    let program =
        path.join("examples").join(example).with_extension(std::env::consts::EXE_EXTENSION);
    let output = Command::new(&program)
        .args(args)
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .output()
        .unwrap_or_else(|error| panic!("{}: {error}", program.display()));
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).expect("examples print text")
}

#[test]
fn plan_route_prints_a_route() {
    let printed = run("plan_route", &[]);
    assert!(printed.contains(" km, climb ") && printed.ends_with(" m\n"), "{printed}");
}

#[test]
fn the_curvature_route_goes_round_the_ridge() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let printed = run("ridge", &[folder.path().to_str().expect("an ASCII path")]);
    let rows: Vec<Vec<f64>> = printed
        .lines()
        .skip(1)
        .map(|line| line.split(", ").skip(1).map(|cell| cell.parse().expect(cell)).collect())
        .collect();
    let [isotropic, curvature] = &rows[..] else { panic!("{printed}") };
    // Columns: length, climb, total normal curvature, cost under isotropic, cost under curvature.
    assert!(curvature[0] > isotropic[0] && curvature[1] < isotropic[1], "{printed}");
    assert!(curvature[2] < 0.8 * isotropic[2], "{printed}");
    assert!(
        isotropic[3] == 1.0 && curvature[4] == 1.0,
        "each is best under its own metric: {printed}"
    );
    assert!(isotropic[4] > 1.05, "{printed}");
    assert!(
        std::fs::read(folder.path().join("ridge.png"))
            .expect("the picture")
            .starts_with(b"\x89PNG")
    );
}

#[test]
fn accuracy_is_what_the_documentation_says() {
    let printed = run("accuracy", &[]);
    let column = |row: &str, cell: usize| -> String {
        let line =
            printed.lines().find(|line| line.contains(row)).unwrap_or_else(|| panic!("{row}"));
        line.split('|').nth(cell).unwrap_or_else(|| panic!("{line}")).trim().to_owned()
    };
    let worst = printed.lines().next().expect("a first line");
    let percent: f64 = worst.split(' ').rev().nth(1).and_then(|p| p.parse().ok()).expect(worst);
    assert!(percent < 0.4, "{worst}");
    for (case, most) in [
        ("constant tensor, ratio 1 ", 9e-4),
        ("constant tensor, ratio 100", 1e-3),
        ("plane of slope", 9e-4),
        ("cylinder, isotropic", 9e-4),
        ("cylinder, curvature", 9e-4),
        ("sphere cap, isotropic", 1.3e-3),
        ("sphere cap, curvature", 1.3e-3),
    ] {
        let (error, order) = (column(case, 5), column(case, 6));
        assert!(error.parse::<f64>().expect(&error) < most, "{case}: {error}");
        assert!(order.parse::<f64>().expect(&order) > 0.65, "{case}: order {order}");
    }
    for case in ["cylinder, curvature", "diffeomorphism"] {
        let row = printed.lines().rfind(|line| line.contains(case)).expect(case);
        let most = row.split('|').nth(5).and_then(|cell| cell.trim().split(' ').next()).expect(row);
        assert!(most.parse::<f64>().expect(most) < 0.003, "{row}");
    }
}

#[test]
fn the_problems_are_solved_to_first_order() {
    // Largest mean error at 201² nodes; the ways of the others have no closed form.
    let known = [
        ("constant-1", 4e-3),
        ("constant-25", 9e-3),
        ("diffeomorphism", 9e-3),
        ("linear-speed", 4e-3),
        ("cylinder", 5e-3),
        ("sphere-cap", 5e-3),
    ];
    let unknown = ["hills", "random-speed", "rotating", "maze", "spiral"];
    let names: Vec<_> = known.iter().map(|(name, _)| *name).chain(unknown).collect();
    let names = names.join(",");
    let printed = run("solve_problem", &["--problem", &names, "--size", "201", "--repeat", "1"]);
    let reports: Vec<serde_json::Value> =
        printed.lines().map(|line| serde_json::from_str(line).expect(line)).collect();
    assert_eq!(reports.len(), known.len() + unknown.len(), "{printed}");
    for (report, (name, most)) in reports.iter().zip(known) {
        let error = &report["error"];
        assert!(report["problem"] == name && error["unreached"] == 0, "{report}");
        assert!(error["mean_relative"].as_f64().is_some_and(|mean| mean < most), "{report}");
    }
}

#[test]
fn figures_of_regions_print_their_numbers_and_draw() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let made = folder.path().join("made/for/it");
    let made = made.to_str().expect("an ASCII path");
    let printed = run("figure_6", &[made]);
    assert!(printed.contains("\n0, 4, 1.0000\n") && printed.contains("walls, 5"), "{printed}");
    let printed = run("figure_3", &[made]);
    assert!(printed.contains("level ground, 6"), "{printed}");
    for name in ["figure-2.png", "figure-3.png", "figure-6.png"] {
        let picture = std::fs::read(std::path::Path::new(made).join(name)).expect(name);
        assert!(picture.starts_with(b"\x89PNG"));
    }
}
