use glam::DVec2;
use ridgeway::eikonal::*;
use ridgeway::terrain::synthetic::*;
use ridgeway::*;
use std::time::Instant;
fn rot(ratio: f64, a: f64) -> Sym2 {
    let (s, c) = a.sin_cos();
    Sym2::new(c * c + s * s / ratio, c * s * (1. - 1. / ratio), s * s + c * c / ratio)
}
fn main() {
    let n: usize = std::env::args().nth(1).unwrap().parse().unwrap();
    let th: usize = std::env::args().nth(2).unwrap().parse().unwrap();
    let reps: usize = std::env::args().nth(3).unwrap().parse().unwrap();
    let only = std::env::args().nth(4);
    let control = Control::default();
    rayon::ThreadPoolBuilder::new().num_threads(th).build_global().unwrap();
    let mut fields: Vec<(String, TensorField)> = vec![];
    let want = |s: &str| only.as_ref().is_none_or(|o| o.split(',').any(|x| x == s));
    for (kind, nm) in [(SyntheticKind::Range, "range"), (SyntheticKind::Bumps, "bumps")] {
        if !want(nm) {
            continue;
        }
        let t = Synthetic::new(kind, n, n, 30.)
            .unwrap()
            .with_seed(1)
            .terrain(Crs::none(), DVec2::ZERO)
            .unwrap();
        let s = HeightSurface::fit(&t, &FitOptions::default(), &control).unwrap();
        for m in [Metric::Isotropic, Metric::Curvature(Default::default())] {
            let f = m.on(&s, &Modifiers::default()).unwrap();
            fields.push((format!("{nm}-{}", f.name()), TensorField::sample(&f, &control).unwrap()));
        }
    }
    for r in [1., 4., 25., 100., 400.] {
        let nm = format!("c{r}");
        if want(&nm) {
            fields.push((
                nm,
                TensorField::from_fn(n, n, |_, _| Some(rot(r, 0.5235)), &control).unwrap(),
            ));
        }
    }
    let hash = |c: usize, r: usize| {
        let mut z = (c as u64) * 0x9E3779B97F4A7C15 ^ (r as u64).wrapping_mul(0xBF58476D1CE4E5B9);
        z ^= z >> 31;
        z = z.wrapping_mul(0x94D049BB133111EB);
        z ^= z >> 29;
        (z >> 11) as f64 / (1u64 << 53) as f64
    };
    if want("random") {
        fields.push((
            "random".into(),
            TensorField::from_fn(
                n,
                n,
                |c, r| {
                    let v = hash(c, r) * 4.605;
                    Some(Sym2::new(1., 0., 1.) * v.exp())
                },
                &control,
            )
            .unwrap(),
        ));
    }
    if want("maze") {
        fields.push((
            "maze".into(),
            TensorField::from_fn(
                n,
                n,
                |c, r| {
                    let wall = r % 20 == 10 && {
                        let k = (r / 20) % 2;
                        if k == 0 { c > 15 } else { c + 15 < n }
                    };
                    (!wall).then(|| Sym2::new(1., 0., 1.))
                },
                &control,
            )
            .unwrap(),
        ));
    }
    if want("p3") {
        fields.push((
            "p3".into(),
            TensorField::from_fn(
                n,
                n,
                |c, r| {
                    let p = DVec2::new(c as f64, r as f64) / (n as f64 - 1.) - 0.5;
                    let t = std::f64::consts::TAU;
                    let (a, b) = (0.1 * t * (t * p.y).cos(), 0.1 * t * (t * p.x).cos());
                    Some(Sym2::new(1. + b * b, a + b, 1. + a * a).inverse())
                },
                &control,
            )
            .unwrap(),
        ));
    }
    for (nm, f) in &fields {
        let start = if nm == "maze" { DVec2::splat(3.) } else { DVec2::splat((n / 2) as f64) };
        let mut best = f64::MAX;
        let mut all = vec![];
        let mut st = None;
        for _ in 0..reps {
            let g = f.clone();
            let t = Instant::now();
            let m = Solver::default().solve_field(g, &start.into(), &[], &control).unwrap();
            let e = t.elapsed().as_secs_f64() * 1e9 / (n * n) as f64;
            best = best.min(e);
            all.push(e);
            st = Some(m.statistics());
            if std::env::var("SUM").is_ok() {
                let v = m.to_row_major();
                let s: f64 = v.iter().filter(|x| x.is_finite()).map(|&x| x as f64).sum();
                println!("  sum {s}");
            }
        }
        all.sort_by(f64::total_cmp);
        let s = st.unwrap();
        let nt = (n.div_ceil(16) * n.div_ceil(16)) as f64;
        println!(
            "{nm:18} n={n} th={th} min {best:6.1} med {:6.1} ns/node  acts/tile {:.2} sweeps/tile {:.2} rounds {}",
            all[all.len() / 2],
            s.activations as f64 / nt,
            s.sweeps as f64 / nt,
            s.rounds
        );
    }
}
