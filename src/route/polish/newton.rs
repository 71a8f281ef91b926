//! Newton's method on the length of a line.

use std::ops::Range;

use glam::DVec2;

use super::{MOST_STEPS, normals};
use crate::linalg::Sym2;

/// Step in cells of the differences of the metric across the line. The curvature tensor has kinks where a curvature
/// is 0, and the line ends as far from them as this is coarse: twice the step shortens routes by a tenth less, while half
/// of it needs a finer quadrature.
const PROBE: f64 = 0.25;
/// No point moves farther at once, in cells: walls are met gently.
const LONGEST_MOVE: f64 = 1.0;
/// A line that moves less, in cells, has converged.
const LEAST_MOVE: f64 = 1e-3;
/// So has one that became shorter by less than this share: what is left to gain is less still.
const LEAST_GAIN: f64 = 1e-7;
/// A step that should bring less than this share of the length, and brings nothing, is noise.
const NOISE: f64 = 1e-6;
/// The least shift above 0, and the one beyond which the search for a step is given up.
const SHIFTS: Range<f64> = 1e-3..1e6;

/// Moves the points to where the length is least, or nearer to there. Returns the last shift.
pub(super) fn relax(
    points: &mut Vec<DVec2>,
    metric: &impl Fn(DVec2) -> Sym2,
    clear: &impl Fn(DVec2, DVec2) -> bool,
) -> f64 {
    let (held, middles) = (vec![false; points.len()], at_middles(points, metric));
    let mut line = Relaxation { points, middles, held, shift: 0.0, metric, clear };
    for _ in 0..MOST_STEPS {
        let length = length(line.points, &line.middles);
        let Some(Move { farthest, gained }) = line.step(length) else { break };
        if farthest < LEAST_MOVE || gained < LEAST_GAIN * length {
            break;
        }
        line.shift = if line.shift > SHIFTS.start { 0.2 * line.shift } else { 0.0 };
    }
    line.shift
}

/// A line on its way to the shortest one.
struct Relaxation<'a, M, C> {
    points: &'a mut Vec<DVec2>,
    /// The metric at the middles of the segments.
    middles: Vec<Sym2>,
    /// Which points stay, for a wall is in the way.
    held: Vec<bool>,
    shift: f64,
    metric: &'a M,
    clear: &'a C,
}

/// What a step did.
struct Move {
    /// How far the point moves that moves farthest, in cells.
    farthest: f64,
    /// By how much the line became shorter.
    gained: f64,
}

/// How a step ended.
enum Attempt {
    Shorter(Move),
    /// The line would be longer, or there is no step: a larger shift may help.
    Longer,
    /// Points met walls and are held from now on.
    Blocked,
    /// Nothing is left to gain.
    Noise,
}

impl<M: Fn(DVec2) -> Sym2, C: Fn(DVec2, DVec2) -> bool> Relaxation<'_, M, C> {
    /// A Newton step from a line of this length, with ever larger shifts until it makes the line shorter; `None` if none
    /// does.
    fn step(&mut self, length: f64) -> Option<Move> {
        let normals = normals(self.points);
        let newton = Newton::new(self.points, &normals, &self.middles, self.metric);
        loop {
            match self.attempt(&newton, &normals, length) {
                Attempt::Shorter(moved) => return Some(moved),
                Attempt::Noise => return None,
                Attempt::Blocked => continue,
                Attempt::Longer => self.shift = (8.0 * self.shift).max(SHIFTS.start),
            }
            if self.shift > SHIFTS.end {
                return None;
            }
        }
    }

    /// The step with the shift as it is; the line takes it if it becomes no longer.
    fn attempt(&mut self, newton: &Newton, normals: &[DVec2], length: f64) -> Attempt {
        let Some(mut step) = newton.step(self.shift, &self.held) else { return Attempt::Longer };
        let farthest = step.iter().fold(0.0, |most: f64, s| most.max(s.abs()));
        shorten(&mut step, (LONGEST_MOVE / farthest).min(1.0));
        let moved = advance(self.points, normals, &mut step, &mut self.held, self.clear);
        let Some(moved) = moved else { return Attempt::Blocked };
        let middles = at_middles(&moved, self.metric);
        let gained = length - self::length(&moved, &middles);
        if gained >= 0.0 {
            (*self.points, self.middles) = (moved, middles);
            return Attempt::Shorter(Move { farthest, gained });
        }
        let is_noise = farthest < LEAST_MOVE || newton.predicted_decrease(&step) < NOISE * length;
        if is_noise { Attempt::Noise } else { Attempt::Longer }
    }
}

fn shorten(step: &mut [f64], share: f64) {
    step.iter_mut().for_each(|s| *s *= share);
}

/// The line after a step, or as much of it as meets no wall; `None` if that is hardly any: then the points that are
/// in the way are held from now on.
fn advance(
    points: &[DVec2],
    normals: &[DVec2],
    step: &mut [f64],
    held: &mut [bool],
    clear: &impl Fn(DVec2, DVec2) -> bool,
) -> Option<Vec<DVec2>> {
    /// A step is halved so often before a point is held: then it lies within an eighth of a step of the wall.
    const HALVINGS: usize = 5;
    let mut hits = Vec::new();
    for _ in 0..=HALVINGS {
        let moved: Vec<DVec2> =
            points.iter().zip(normals).zip(&*step).map(|((p, n), &s)| p + n * s).collect();
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

/// Derivatives of `L` by the `s_i`.
struct Newton {
    gradient: Vec<f64>,
    diagonal: Vec<f64>,
    /// `∂²L/∂s_i∂s_{i+1}`.
    off_diagonal: Vec<f64>,
    /// What the shift is a multiple of: `Σ nᵀ M n / |d|` over the two segments of a point.
    tension: Vec<f64>,
}

impl Newton {
    fn new(
        points: &[DVec2],
        normals: &[DVec2],
        middles: &[Sym2],
        metric: &impl Fn(DVec2) -> Sym2,
    ) -> Self {
        let zeros = || vec![0.0; points.len()];
        let mut sums =
            Self { gradient: zeros(), diagonal: zeros(), off_diagonal: zeros(), tension: zeros() };
        for (k, &middle) in middles.iter().enumerate() {
            sums.add(k, [points[k], points[k + 1]], [normals[k], normals[k + 1]], middle, metric);
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
        self.off_diagonal[k] = (0.5 * dpq - dp * dq) / l;
        self.tension[k] += middle.form(m) / l;
        self.tension[k + 1] += middle.form(n) / l;
    }

    /// The `s_i` for a shift, 0 at both ends and where held; `None` where the shifted Hessian is not positive definite.
    fn step(&self, shift: f64, held: &[bool]) -> Option<Vec<f64>> {
        let last = self.gradient.len() - 1;
        let is_free = |i: usize| i > 0 && i < last && !held[i];
        // L D Lᵀ: `multiplier` is the entry of L next to the diagonal in row i.
        let mut pivots = vec![f64::INFINITY; self.gradient.len()];
        let mut step = vec![0.0; self.gradient.len()];
        for i in (0..last).filter(|&i| is_free(i)) {
            let multiplier = self.off_diagonal[i - 1] / pivots[i - 1];
            pivots[i] =
                self.diagonal[i] + shift * self.tension[i] - multiplier * self.off_diagonal[i - 1];
            if pivots[i].is_nan() || pivots[i] <= 0.0 {
                return None;
            }
            step[i] = -self.gradient[i] - multiplier * step[i - 1];
        }
        for i in (0..last).rev().filter(|&i| is_free(i)) {
            step[i] = (step[i] - self.off_diagonal[i] * step[i + 1]) / pivots[i];
        }
        Some(step)
    }

    /// By how much a step should shorten the line, to second order near the minimum.
    fn predicted_decrease(&self, step: &[f64]) -> f64 {
        -0.5 * self.gradient.iter().zip(step).map(|(g, s)| g * s).sum::<f64>()
    }
}
