//! Polishing: a line is moved sideways until its length on the surface is least.
//!
//! The traced line inherits the error of the distance it descends on: it lies up to a cell or two beside the
//! shortest line. From there Newton's method finds that line on the metric itself. With a unit vector `n_i` across the
//! line at each point, the points `p_i + s_i n_i` make the segments `d = p_{i+1} − p_i` with middles `c`, and
//!
//! ```text
//!   L(s) = Σ √(dᵀ M(c) d)  →  min ,      both ends fixed
//! ```
//!
//! Each term depends on two neighbours, so the Hessian is tridiagonal. Points cannot move along the line: that leaves
//! its shape free, and they cannot gather where the sum is too small an estimate of the length (as they would with
//! both coordinates free, skipping what is costly). A shift in proportion to the tension of the segments, `n_iᵀ M n_i / |d|`, makes
//! the Hessian positive definite and the steps decrease `L` (Levenberg, Marquardt; Nocedal and Wright, Numerical
//! Optimization, ch. 10).
//!
//! A point that would meet a wall is held before it. What was not shortened by a finer quadrature stays as traced.
//!
//! Where the metric jumps, `L` has no derivatives to go by, and one corner of costly ground stops the whole line. Such a line is
//! searched for by dynamic programming (Amini, Weymouth, Jain, IEEE PAMI 12, 1990), which needs none.

use glam::DVec2;

use crate::linalg::Sym2;
use crate::metric::length_along;

/// Longest segment in cells. The curvature tensor changes within a cell: on rough ground segments of one cell shorten routes
/// by a half to two thirds of what those of half a cell do, a quarter by 1.1 times as much for twice the work.
const SEGMENT: f64 = 0.5;
/// Step in cells of the differences of the metric across the line. The curvature tensor has kinks where a curvature
/// is 0, and the line ends as far from them as this is coarse: twice the step shortens routes by a tenth less, while half
/// of it needs a finer quadrature.
const PROBE: f64 = 0.25;
/// No point moves farther at once, in cells: walls are met gently.
const LONGEST_MOVE: f64 = 1.0;
/// A line that moves less, in cells, has arrived.
const STILL: f64 = 1e-3;
/// So has one that became shorter by less than this share: what is left to gain is less still.
const LEAST_GAIN: f64 = 1e-7;
/// A step that should bring less than this share of the length, and brings nothing, is noise.
const NOISE: f64 = 1e-6;
/// Enough for all but a few lines on the roughest ground; smooth metrics need 3 to 5.
const MOST_STEPS: usize = 40;
/// Shifts between the first one above 0 and the end of all hope.
const SHIFTS: std::ops::Range<f64> = 1e-3..1e6;
/// A line that ends with a larger shift hardly moved, for the metric jumps beside it. The curvature tensor on rough ground ends
/// with up to 200, costs that jump by 1 : 10 with 70 to 3000, by 1 : 50 with 27 000.
const JUMP: f64 = 1e3;
/// Steps of the search in cells. The finer ones are of no use before the coarser.
const STRIDES: [f64; 5] = [1.0, 0.5, 0.25, 0.125, 0.0625];
/// A search that shortens the line by less than this share goes on with the next stride.
const WORTH: f64 = 1e-4;

/// The line, nowhere longer than `line`, between the same ends. `metric` is `M` in grid coordinates; `clear` tells
/// whether one may go straight from one point to another nearby.
pub(super) fn polish(
    line: &[DVec2],
    metric: &impl Fn(DVec2) -> Sym2,
    clear: &impl Fn(DVec2, DVec2) -> bool,
) -> Vec<DVec2> {
    if line.len() < 3 {
        return line.to_vec();
    }
    let line = &refine(line);
    let kept = thin(line, clear);
    let mut points: Vec<DVec2> = kept.iter().map(|&i| line[i]).collect();
    let shift = relax(&mut points, metric, clear);
    let best = shorter(line, &kept, &points, metric);
    if shift > JUMP { search(best, metric, clear) } else { best }
}

/// The same line with points enough that no segment is longer than [`SEGMENT`].
fn refine(line: &[DVec2]) -> Vec<DVec2> {
    let pieces = line.windows(2).flat_map(|ends| {
        let count = (ends[0].distance(ends[1]) / SEGMENT - 1e-9).ceil().max(1.0);
        (0..count as usize).map(move |i| ends[0].lerp(ends[1], i as f64 / count))
    });
    pieces.chain(line.last().copied()).collect()
}

/// Indices of as few points as keep the segments clear and no longer than [`SEGMENT`].
fn thin(line: &[DVec2], clear: &impl Fn(DVec2, DVec2) -> bool) -> Vec<usize> {
    let last = line.len() - 1;
    let mut kept = vec![0];
    let mut from = line[0];
    for i in 1..last {
        let next = line[i + 1];
        if from.distance(next) > SEGMENT * (1.0 + 1e-9) || !clear(from, next) {
            kept.push(i);
            from = line[i];
        }
    }
    kept.push(last);
    kept
}

/// Between points that both lines share, the shorter of both by a finer quadrature than the one that was minimised.
fn shorter(
    line: &[DVec2],
    kept: &[usize],
    points: &[DVec2],
    metric: &impl Fn(DVec2) -> Sym2,
) -> Vec<DVec2> {
    let length = |line: &[DVec2]| finely(line, metric);
    let shared: Vec<usize> = (0..kept.len()).filter(|&k| points[k] == line[kept[k]]).collect();
    let mut best = vec![line[0]];
    for ends in shared.windows(2) {
        let old = &line[kept[ends[0]]..=kept[ends[1]]];
        let new = &points[ends[0]..=ends[1]];
        let pick = if length(new) < length(old) { new } else { old };
        best.extend(&pick[1..]);
    }
    best
}

/// Length by the finer quadrature.
fn finely(line: &[DVec2], metric: &impl Fn(DVec2) -> Sym2) -> f64 {
    length_along(line, |at, by| metric(at).norm(by))
}

/// The line moved sideways by ever smaller steps, each time to the best of all lines beside it.
fn search(
    mut line: Vec<DVec2>,
    metric: &impl Fn(DVec2) -> Sym2,
    clear: &impl Fn(DVec2, DVec2) -> bool,
) -> Vec<DVec2> {
    let mut least = finely(&line, metric);
    for stride in STRIDES {
        line = refine(&line);
        for _ in 0..MOST_STEPS {
            let (length, moved) = best_beside(&line, stride, metric, clear);
            if length.is_nan() || length >= (1.0 - WORTH) * least {
                break;
            }
            (least, line) = (length, moved);
        }
    }
    line
}

/// The shortest of the lines whose points each stay or go a stride to either side, and its length: the best way to each
/// place of a point goes by the best way to a place of the point before it.
fn best_beside(
    line: &[DVec2],
    stride: f64,
    metric: &impl Fn(DVec2) -> Sym2,
    clear: &impl Fn(DVec2, DVec2) -> bool,
) -> (f64, Vec<DVec2>) {
    let last = line.len() - 1;
    let across = across(line);
    let sides = |i: usize| if i > 0 && i < last { across[i] * stride } else { DVec2::ZERO };
    // The first place is to stay: that is always allowed, and wins where nothing is gained.
    let places = |i: usize| [0.0, 1.0, -1.0].map(|side| line[i] + sides(i) * side);
    let mut lengths = [0.0; 3];
    let mut origins = Vec::with_capacity(last);
    for i in 1..line.len() {
        let (from, to) = (places(i - 1), places(i));
        let way = |j: usize, k: usize| {
            let open = (j, k) == (0, 0) || clear(from[j], to[k]);
            if open { lengths[j] + finely(&[from[j], to[k]], metric) } else { f64::INFINITY }
        };
        let best = [0, 1, 2].map(|k| {
            let ways = [0, 1, 2].map(|j| way(j, k));
            let least = (1..3).fold(0, |best, j| if ways[j] < ways[best] { j } else { best });
            (ways[least], least)
        });
        lengths = best.map(|(length, _)| length);
        origins.push(best.map(|(_, origin)| origin));
    }
    let mut place = 0;
    let mut moved = vec![line[last]];
    for (i, origins) in origins.iter().enumerate().rev() {
        place = origins[place];
        moved.push(places(i)[place]);
    }
    moved.reverse();
    (lengths[0], moved)
}

/// Moves the points to where the length is least, or nearer to there. Returns the last shift.
fn relax(
    points: &mut Vec<DVec2>,
    metric: &impl Fn(DVec2) -> Sym2,
    clear: &impl Fn(DVec2, DVec2) -> bool,
) -> f64 {
    let mut held = vec![false; points.len()];
    let mut middles = at_middles(points, metric);
    let mut shift = 0.0;
    for _ in 0..MOST_STEPS {
        let length = length(points, &middles);
        let across = across(points);
        let newton = Newton::new(points, &across, &middles, metric);
        let (farthest, gained) = loop {
            let step = newton.step(shift, &held);
            if let Some(mut step) = step {
                let farthest = step.iter().fold(0.0, |most: f64, s| most.max(s.abs()));
                shorten(&mut step, (LONGEST_MOVE / farthest).min(1.0));
                let Some(moved) = advance(points, &across, &mut step, &mut held, clear) else {
                    continue;
                };
                let moved_middles = at_middles(&moved, metric);
                let gain = length - self::length(&moved, &moved_middles);
                if gain >= 0.0 {
                    (*points, middles) = (moved, moved_middles);
                    break (farthest, gain);
                }
                if farthest < STILL || newton.promise(&step) < NOISE * length {
                    return shift;
                }
            }
            shift = (8.0 * shift).max(SHIFTS.start);
            if shift > SHIFTS.end {
                return shift;
            }
        };
        if farthest < STILL || gained < LEAST_GAIN * length {
            return shift;
        }
        shift = if shift > SHIFTS.start { 0.2 * shift } else { 0.0 };
    }
    shift
}

fn shorten(step: &mut [f64], share: f64) {
    step.iter_mut().for_each(|s| *s *= share);
}

/// The line after a step, or as much of it as meets no wall; `None` if that is hardly any: then the points that are
/// in the way are held from now on.
fn advance(
    points: &[DVec2],
    across: &[DVec2],
    step: &mut [f64],
    held: &mut [bool],
    clear: &impl Fn(DVec2, DVec2) -> bool,
) -> Option<Vec<DVec2>> {
    /// A step is halved so often before a point is held: then it lies within an eighth of a step of the wall.
    const HALVINGS: usize = 5;
    let mut hits = Vec::new();
    for _ in 0..=HALVINGS {
        let moved: Vec<DVec2> =
            points.iter().zip(across).zip(&*step).map(|((p, n), &s)| p + n * s).collect();
        let moves = |k: usize| step[k] != 0.0 || step[k + 1] != 0.0;
        hits =
            (0..points.len() - 1).filter(|&k| moves(k) && !clear(moved[k], moved[k + 1])).collect();
        if hits.is_empty() {
            return Some(moved);
        }
        shorten(step, 0.5);
    }
    for k in hits {
        held[k..k + 2].fill(true);
    }
    None
}

/// The metric at the middles of the segments.
fn at_middles(points: &[DVec2], metric: &impl Fn(DVec2) -> Sym2) -> Vec<Sym2> {
    points.windows(2).map(|ends| metric(ends[0].midpoint(ends[1]))).collect()
}

/// `L`.
fn length(points: &[DVec2], middles: &[Sym2]) -> f64 {
    points.windows(2).zip(middles).map(|(ends, metric)| metric.norm(ends[1] - ends[0])).sum()
}

/// Unit vectors across the line, in grid coordinates.
fn across(points: &[DVec2]) -> Vec<DVec2> {
    let last = points.len() - 1;
    (0..points.len())
        .map(|i| (points[last.min(i + 1)] - points[i.saturating_sub(1)]).perp().normalize_or_zero())
        .collect()
}

/// Derivatives of `L` by the `s_i`.
struct Newton {
    gradient: Vec<f64>,
    diagonal: Vec<f64>,
    /// `∂²L/∂s_i∂s_{i+1}`.
    beside: Vec<f64>,
    /// What the shift is counted in: `Σ nᵀ M n / |d|` over the two segments of a point.
    tension: Vec<f64>,
}

impl Newton {
    fn new(
        points: &[DVec2],
        across: &[DVec2],
        middles: &[Sym2],
        metric: &impl Fn(DVec2) -> Sym2,
    ) -> Self {
        let zeros = || vec![0.0; points.len()];
        let mut sums =
            Self { gradient: zeros(), diagonal: zeros(), beside: zeros(), tension: zeros() };
        for (k, &middle) in middles.iter().enumerate() {
            sums.add(k, [points[k], points[k + 1]], [across[k], across[k + 1]], middle, metric);
        }
        sums
    }

    /// Adds the segment `k` from `p` to `q` with `l² = dᵀ M(c) d`. Its ends move along `m` and `n`, its middle along
    /// both halves, and `M` has the derivatives `M′`, `M″` along `(m + n)/2`:
    ///
    /// ```text
    ///   ∂l² = ∓2 nᵀMd + dᵀM′d/2 ,     ∂²l² = ±2 nᵀMn ∓2 nᵀM′d + dᵀM″d/4 ,     ∂²l = ∂²l²/2l − ∂l² ∂l²/4l³
    /// ```
    fn add(
        &mut self,
        k: usize,
        [p, q]: [DVec2; 2],
        [m, n]: [DVec2; 2],
        middle: Sym2,
        metric: &impl Fn(DVec2) -> Sym2,
    ) {
        let (c, d, probe) = (p.midpoint(q), q - p, PROBE * m.midpoint(n));
        let (left, right) = (metric(c + probe), metric(c - probe));
        let first = (left + right * -1.0) * (0.5 / PROBE);
        let second = (left + right + middle * -2.0) * PROBE.powi(-2);

        let l = middle.norm(d);
        let (md, m1d) = (middle.apply(d), first.apply(d));
        let (slope, bend) = (0.5 * d.dot(m1d), 0.25 * second.form(d));
        let dp = (slope - 2.0 * m.dot(md)) / (2.0 * l);
        let dq = (slope + 2.0 * n.dot(md)) / (2.0 * l);
        let dpp = bend + 2.0 * middle.form(m) - 2.0 * m.dot(m1d);
        let dqq = bend + 2.0 * middle.form(n) + 2.0 * n.dot(m1d);
        let dpq = bend - 2.0 * m.dot(middle.apply(n)) + (n - m).dot(m1d);

        self.gradient[k] += dp;
        self.gradient[k + 1] += dq;
        self.diagonal[k] += (0.5 * dpp - dp * dp) / l;
        self.diagonal[k + 1] += (0.5 * dqq - dq * dq) / l;
        self.beside[k] = (0.5 * dpq - dp * dq) / l;
        self.tension[k] += middle.form(m) / l;
        self.tension[k + 1] += middle.form(n) / l;
    }

    /// The `s_i` for a shift, 0 at both ends and where held; `None` where the shifted Hessian is not positive definite.
    fn step(&self, shift: f64, held: &[bool]) -> Option<Vec<f64>> {
        let last = self.gradient.len() - 1;
        let is_free = |i: usize| i > 0 && i < last && !held[i];
        // L D Lᵀ: `share[i]` is the entry of L beside the diagonal in row i + 1.
        let mut pivots = vec![f64::INFINITY; self.gradient.len()];
        let mut step = vec![0.0; self.gradient.len()];
        for i in (0..last).filter(|&i| is_free(i)) {
            let share = self.beside[i - 1] / pivots[i - 1];
            pivots[i] = self.diagonal[i] + shift * self.tension[i] - share * self.beside[i - 1];
            if pivots[i].is_nan() || pivots[i] <= 0.0 {
                return None;
            }
            step[i] = -self.gradient[i] - share * step[i - 1];
        }
        for i in (0..last).rev().filter(|&i| is_free(i)) {
            step[i] = (step[i] - self.beside[i] * step[i + 1]) / pivots[i];
        }
        Some(step)
    }

    /// By how much a step should shorten the line, about.
    fn promise(&self, step: &[f64]) -> f64 {
        -0.5 * self.gradient.iter().zip(step).map(|(g, s)| g * s).sum::<f64>()
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use super::super::descent;
    use super::*;
    use crate::control::Control;
    use crate::eikonal::{DistanceMap, Solver, Stop};
    use crate::eikonal::{TensorField, sees};

    const IDENTITY: Sym2 = Sym2::new(1.0, 0.0, 1.0);

    /// The distance on the nodes of an `n × n` grid under a metric that is known everywhere.
    fn solve(n: usize, start: DVec2, metric: impl Fn(DVec2) -> Option<Sym2> + Sync) -> DistanceMap {
        let tensor = |c, r| Some(metric(DVec2::new(c as f64, r as f64))?.inverse());
        let field = TensorField::from_fn(n, n, tensor, &Control::default()).unwrap();
        Solver::default()
            .solve_field(field, &[start.into()], &Stop::Never, &Control::default())
            .unwrap()
    }

    fn cost(line: &[DVec2], metric: impl Fn(DVec2) -> Sym2) -> f64 {
        length_along(line, |at, by| metric(at).norm(by))
    }

    fn polished(
        distance: &DistanceMap,
        goal: DVec2,
        metric: impl Fn(DVec2) -> Sym2,
    ) -> [Vec<DVec2>; 2] {
        let last = DVec2::splat((distance.cols() - 1) as f64);
        let inside = |p: DVec2| p.cmpge(DVec2::ZERO).all() && p.cmple(last).all();
        let clear = |a, b| inside(a) && inside(b) && sees(&distance.field, a, b);
        let line = descent::line(distance, goal).unwrap();
        let polished = polish(&line, &metric, &clear);
        assert_eq!((polished[0], polished[polished.len() - 1]), (line[0], goal));
        assert!(cost(&polished, &metric) <= cost(&line, &metric));
        assert!(polished.windows(2).all(|ends| clear(ends[0], ends[1])));
        [line, polished]
    }

    #[test]
    fn lines_on_a_constant_metric_become_straight() {
        for ratio in [1.0, 4.0, 25.0, 100.0, 400.0] {
            let along = DVec2::from_angle(0.5);
            let metric = Sym2::outer(along) + Sym2::outer(along.perp()) * ratio;
            let start = DVec2::new(100.3, 99.6);
            let distance = solve(201, start, |_| Some(metric));
            for k in 0..40 {
                let goal = start + 95.0 * DVec2::from_angle(0.157 * f64::from(k));
                let [_, line] = polished(&distance, goal, |_| metric);
                let across = (goal - start).normalize();
                let stray = line.iter().map(|p| (*p - start).perp_dot(across).abs());
                let stray = stray.fold(0.0, f64::max);
                assert!(stray < 5e-3, "ratio {ratio}, goal {goal}: {stray} cells");
                let error = cost(&line, |_| metric) / metric.norm(goal - start) - 1.0;
                assert!(error.abs() < 1e-6, "ratio {ratio}, goal {goal}: {error}");
            }
        }
    }

    #[test]
    fn a_diffeomorphism_pulls_straight_lines_back() {
        // M = ΦᵀΦ with Φ = Dφ: distance is ‖φ(x) − φ(x0)‖ and routes are the preimages of straight lines.
        let phi = |p: DVec2| p + 0.1 * DVec2::new((TAU * p.y).sin(), (TAU * p.x).sin());
        let n = 401;
        let h = 1.0 / (n - 1) as f64;
        let at = |p: DVec2| p * h - 0.5;
        let metric = |p: DVec2| {
            let p = at(p);
            let (a, b) = (0.1 * TAU * (TAU * p.y).cos(), 0.1 * TAU * (TAU * p.x).cos());
            Sym2::new(1.0 + b * b, a + b, 1.0 + a * a) * (h * h)
        };
        let start = DVec2::splat((n / 2) as f64);
        let distance = solve(n, start, |p| Some(metric(p)));
        for k in 0..40 {
            let goal = start + 0.3 / h * DVec2::from_angle(TAU * f64::from(k) / 40.0);
            let [_, line] = polished(&distance, goal, metric);
            let end = phi(at(goal));
            let stray = line.iter().map(|&p| phi(at(p)).perp_dot(end.normalize()).abs() / h);
            let stray = stray.fold(0.0, f64::max);
            let error = cost(&line, metric) / end.length() - 1.0;
            assert!(stray < 0.01 && error.abs() < 1e-6, "goal {goal}: {stray} cells, {error}");
        }
    }

    #[test]
    fn lines_round_a_wall_are_taut() {
        // A wall with a square end: the shortest way touches the corners of the cells of its last nodes.
        let (start, goal) = (DVec2::new(60.0, 20.2), DVec2::new(65.0, 100.7));
        let wall = |p: DVec2| p.x <= 80.0 && (p.y - 60.0).abs() <= 2.0;
        let distance = solve(121, start, |p| (!wall(p)).then_some(IDENTITY));
        let corners = [DVec2::new(80.5, 57.5), DVec2::new(80.5, 62.5)];
        let exact = cost(&[start, corners[0], corners[1], goal], |_| IDENTITY);
        let lines = polished(&distance, goal, |_| IDENTITY);
        let [traced, polished] = lines.map(|line| cost(&line, |_| IDENTITY) / exact - 1.0);
        assert!(traced > 3e-3 && polished < 8e-4, "{traced} {polished}");
    }

    #[test]
    fn lines_keep_out_of_rough_walls() {
        // Random metric and random walls; `polished` looks at every segment.
        let random = |p: DVec2, salt: f64| {
            ((p.x * 12.9898 + p.y * 78.233 + salt).sin() * 43758.5453).rem_euclid(1.0)
        };
        let metric = |p: DVec2| {
            let along = DVec2::from_angle(0.1 * p.x + (0.13 * p.y).sin());
            Sym2::outer(along)
                + Sym2::outer(along.perp()) * (2.0 + (0.3 * p.x).sin() + (0.2 * p.y).cos())
        };
        let start = DVec2::splat(40.0);
        let distance =
            solve(81, start, |p| (random(p, 0.5) > 0.2 || p == start).then(|| metric(p)));
        for k in 0..200 {
            let goal = DVec2::new(f64::from(k % 20), f64::from(k / 20) * 2.0) * 4.0;
            if distance.stored_at(goal).is_some() {
                polished(&distance, goal, metric);
            }
        }
    }

    /// Isotropic costs at the nodes, bilinear between them.
    fn bilinear(node: impl Fn(i64, i64) -> f64, at: DVec2) -> Sym2 {
        let (first, f) = (at.floor(), at - at.floor());
        let node = |i: i64, j: i64| node(first.x as i64 + i, first.y as i64 + j);
        let row = |j| (1.0 - f.x) * node(0, j) + f.x * node(1, j);
        IDENTITY * ((1.0 - f.y) * row(0) + f.y * row(1)).powi(2)
    }

    #[test]
    fn lines_into_costly_ground_are_refracted() {
        // Layers c(x): with the invariant p of Snell's law a line goes ∫ p/√(c² − p²) dx aside and costs ∫ c²/√(c² − p²) dx.
        // Cheap ground of cost 1, a ramp of one cell, and costly ground.
        let layers = |p: f64, cheap: f64, costly: f64, ratio: f64| {
            let root = |c: f64| (c * c - p * p).sqrt();
            let log = |c: f64| (c + root(c)).ln();
            let cost = |c: f64| 0.5 * (c * root(c) + p * p * log(c));
            let ramp = (ratio - 1.0).recip();
            let aside =
                p * (cheap / root(1.0) + ramp * (log(ratio) - log(1.0)) + costly / root(ratio));
            let cost = cheap / root(1.0)
                + ramp * (cost(ratio) - cost(1.0))
                + ratio * ratio * costly / root(ratio);
            (aside, cost)
        };
        for ratio in [10.0, 50.0, 1000.0] {
            let metric = |p| bilinear(|c, _| if c <= 50 { 1.0 } else { ratio }, p);
            let (start, goal) = (DVec2::new(10.0, 20.0), DVec2::new(61.0, 90.0));
            let distance = solve(101, start, |p| Some(metric(p)));
            let (mut low, mut high) = (0.0, 1.0);
            for _ in 0..60 {
                let p = 0.5 * (low + high);
                let short = layers(p, 40.0, 10.0, ratio).0 < goal.y - start.y;
                (low, high) = if short { (p, high) } else { (low, p) };
            }
            let exact = layers(low, 40.0, 10.0, ratio).1;
            let [_, line] = polished(&distance, goal, metric);
            let error = cost(&line, metric) / exact - 1.0;
            assert!(error.abs() < 2e-3, "1 : {ratio}: {error}");
        }
    }

    #[test]
    fn lines_go_around_a_costly_block() {
        // A string around the cheap nodes beside the block; the corners of the ramp save it a trifle.
        let (start, goal) = (DVec2::new(60.0, 20.0), DVec2::new(62.0, 100.0));
        for ratio in [50.0, 1000.0] {
            let block = |c: i64, r: i64| (40..=80).contains(&c) && (50..=70).contains(&r);
            let metric = |p| bilinear(|c, r| if block(c, r) { ratio } else { 1.0 }, p);
            let distance = solve(121, start, |p| Some(metric(p)));
            let corners = [DVec2::new(81.0, 49.0), DVec2::new(81.0, 71.0)];
            let exact = cost(&[start, corners[0], corners[1], goal], |_| IDENTITY);
            let [_, line] = polished(&distance, goal, metric);
            let error = cost(&line, metric) / exact - 1.0;
            assert!((-2e-3..5e-3).contains(&error), "1 : {ratio}: {error}");
        }
    }

    #[test]
    fn lines_keep_to_the_cheap_between_random_patches() {
        let random = |c: i64, r: i64| {
            let mut x = (c as u64) << 32 ^ (r as u64) << 8 ^ 7;
            for _ in 0..3 {
                x = (x ^ x >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
                x ^= x >> 27;
            }
            x >> 63 == 0
        };
        let node =
            |c: i64, r: i64| if random(c.div_euclid(8), r.div_euclid(8)) { 50.0 } else { 1.0 };
        let metric = |p| bilinear(node, p);
        let mut sum = 0.0;
        for (start, goal) in [
            (DVec2::new(8.0, 8.0), DVec2::new(120.0, 117.0)),
            (DVec2::new(10.0, 100.0), DVec2::new(118.0, 20.0)),
            (DVec2::new(5.0, 60.0), DVec2::new(123.0, 66.0)),
            (DVec2::new(64.0, 4.0), DVec2::new(60.0, 124.0)),
        ] {
            let distance = solve(129, start, |p| Some(metric(p)));
            // The truth within 1 %, by a quarter of the cell.
            let fine = solve(513, start * 4.0, |p| Some(metric(p * 0.25) * 0.0625));
            let [_, line] = polished(&distance, goal, metric);
            let cost = cost(&line, metric);
            let ratios = [cost / fine.at(goal * 4.0).unwrap(), cost / distance.at(goal).unwrap()];
            assert!(ratios[0] < 1.1 && ratios[1] < 1.22, "{goal}: {ratios:?}");
            sum += ratios[0];
        }
        assert!(sum / 4.0 < 1.05, "{}", sum / 4.0);
    }

    #[test]
    fn nothing_is_asked_of_lines_and_metrics_that_have_nothing() {
        let anywhere = |_: DVec2, _: DVec2| true;
        let points = [DVec2::ZERO, DVec2::ONE, DVec2::new(2.0, 1.0), DVec2::new(2.0, 1.0)];
        for count in 0..=points.len() {
            let line = polish(&points[..count], &|_| IDENTITY, &anywhere);
            assert_eq!(line.first(), points[..count].first());
            assert_eq!(line.last(), points[..count].last());
        }
        for bad in [0.0, f64::NAN, f64::INFINITY] {
            assert_eq!(polish(&points, &|_| IDENTITY * bad, &anywhere), refine(&points));
        }
        assert_eq!(polish(&points, &|_| IDENTITY, &|_, _| false), refine(&points));
    }
}
