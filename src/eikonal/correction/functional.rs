//! The functional of second order at a node and its least over the segment that the value comes from.

use multiversion::multiversion;

use super::super::field::SIDE;
use super::super::update::{How, Tile, choose, greatest, least, tensors};
use super::feet::Line;
use super::patch::Lanes;

/// Newton steps from the first-order foot to that of the functional.
const NEWTON_STEPS: usize = 2;

/// `vᵀMv` along a segment, `α + 2βθ + γθ²`.
#[derive(Clone, Copy)]
struct Quadratic(f32, f32, f32);

impl Quadratic {
    #[inline(always)]
    fn new([xx, xy, yy]: [f32; 3], [ax, ay]: [f32; 2], [wx, wy]: [f32; 2]) -> Self {
        let (mx, my) = (xx * ax + xy * ay, xy * ax + yy * ay);
        Self(mx * ax + my * ay, mx * wx + my * wy, xx * wx * wx + 2.0 * xy * wx * wy + yy * wy * wy)
    }

    #[inline(always)]
    fn root(self, t: f32) -> f32 {
        greatest(self.0 + t * (2.0 * self.1 + t * self.2), 0.0).sqrt()
    }

    /// The root and its first two derivatives, to five digits: they only lead to the foot, whose error counts squared.
    #[inline(always)]
    fn jet(self, t: f32) -> [f32; 3] {
        let square = greatest(self.0 + t * (2.0 * self.1 + t * self.2), 1e-12);
        let inverse = inverse_root(square);
        let first = (self.1 + t * self.2) * inverse;
        [square * inverse, first, (self.2 - first * first) * inverse]
    }
}

/// `1/√x` to five digits, from the bits of `x` and two Newton steps; a fraction of the time of a root and a division, and
/// the same on every machine.
#[inline(always)]
fn inverse_root(x: f32) -> f32 {
    let mut y = f32::from_bits(0x5f37_59df - (x.to_bits() >> 1));
    for _ in 0..2 {
        y *= 1.5 - 0.5 * x * y * y;
    }
    y
}

/// Finds the foot and the value of the functional for each node of a line.
#[multiversion(targets(
    "x86_64+avx512f+avx512bw+avx512cd+avx512dq+avx512vl",
    "x86_64+avx2",
    "x86_64+sse4.1",
))]
pub(super) fn minimise(tile: &Tile<'_>, row: usize, shifts: &[Lanes; 8], line: &mut Line) {
    minimise_line::<false>(tile, row, shifts, line);
}

/// The same in a tile that lies in a cone.
#[multiversion(targets(
    "x86_64+avx512f+avx512bw+avx512cd+avx512dq+avx512vl",
    "x86_64+avx2",
    "x86_64+sse4.1",
))]
pub(super) fn minimise_in_cone(tile: &Tile<'_>, row: usize, shifts: &[Lanes; 8], line: &mut Line) {
    minimise_line::<true>(tile, row, shifts, line);
}

#[inline(always)]
fn minimise_line<const IN_CONE: bool>(
    tile: &Tile<'_>,
    row: usize,
    shifts: &[Lanes; 8],
    line: &mut Line,
) {
    let how = How { by_columns: false, descending: false };
    let [dxx, dxy, ddet] = tensors(tile, row, how);
    let (m0, from) = match tile.cone {
        Some((cone, first)) => (
            [cone.metric.xx as f32, cone.metric.xy as f32, cone.metric.yy as f32],
            [(first.x - cone.at.x) as f32, (first.y + row as f64 - cone.at.y) as f32],
        ),
        None => ([1.0, 0.0, 1.0], [1.0, 0.0]),
    };
    // Where the cone is taken out some shift is negative.
    let mut on = [0f32; SIDE];
    for shift in shifts {
        for i in 0..SIDE {
            on[i] = choose(shift[i] < 0.0, 1.0, on[i]);
        }
    }
    let [ra, rb, rc, rd] = line.rise;
    let [axx, axy, ayy, bxx, bxy, byy] = line.metric;
    let ([ax, ay], [wx, wy]) = (line.a, line.w);
    let slopes = line.slope;
    let (mut theta, mut rho) = ([0f32; SIDE], [0f32; SIDE]);
    for i in 0..SIDE {
        let idet = 1.0 / ddet[i];
        let dyy = (ddet[i] + dxy[i] * dxy[i]) / dxx[i];
        let m = [dyy * idet, -dxy[i] * idet, dxx[i] * idet];
        let local = Local {
            a: [ax[i], ay[i]],
            w: [wx[i], wy[i]],
            m,
            at_a: choose3(axx[i] > 0.0, [axx[i], axy[i], ayy[i]], m),
            at_b: choose3(bxx[i] > 0.0, [bxx[i], bxy[i], byy[i]], m),
            cone: ConeAt::new(on[i], m0, [from[0] + i as f32, from[1]]),
        };
        (theta[i], rho[i]) = local.minimise::<IN_CONE>([ra[i], rb[i], rc[i], rd[i]], slopes[i]);
    }
    line.theta = theta;
    line.rho = rho;
}

/// The cone seen from a node at `v` from its point, times `on`.
#[derive(Clone, Copy)]
struct ConeAt {
    on: f32,
    m0: [f32; 3],
    v: [f32; 2],
    mv: [f32; 2],
    g2: f32,
    g: f32,
}

impl ConeAt {
    #[inline(always)]
    fn new(on: f32, m0: [f32; 3], v: [f32; 2]) -> Self {
        let mv = [m0[0] * v[0] + m0[1] * v[1], m0[1] * v[0] + m0[2] * v[1]];
        let g2 = greatest(mv[0] * v[0] + mv[1] * v[1], 1e-12);
        Self { on, m0, v, mv, g2, g: g2.sqrt() }
    }

    /// `g0(x + by) − g0(x)`.
    #[inline(always)]
    fn rise(&self, x: f32, y: f32) -> f32 {
        let a = self.mv[0] * x + self.mv[1] * y;
        let b = self.m0[0] * (x * x) + 2.0 * self.m0[1] * (x * y) + self.m0[2] * (y * y);
        let more = 2.0 * a + b;
        self.on * more / (self.g + greatest(self.g2 + more, 0.0).sqrt())
    }
}

/// What a node's functional is made of: the neighbour `a` from the node, `w = b − a`, `M` at the three, and the cone.
#[derive(Clone, Copy)]
struct Local {
    a: [f32; 2],
    w: [f32; 2],
    m: [f32; 3],
    at_a: [f32; 3],
    at_b: [f32; 3],
    cone: ConeAt,
}

impl Local {
    /// `θ` and `ρ`, from how much `a`, `b`, `a − w` and `b + w` are above the node, and the first-order slope.
    #[inline(always)]
    fn minimise<const IN_CONE: bool>(self, [ra, rb, rc, rd]: [f32; 4], slope: f32) -> (f32, f32) {
        let Self { a, w, m, at_a, at_b, cone } = self;
        let (mut wa, mut wb, mut wc, mut wd) = (ra, rb, rc, rd);
        if IN_CONE {
            wa -= cone.rise(a[0], a[1]);
            wb -= cone.rise(a[0] + w[0], a[1] + w[1]);
            wc -= cone.rise(a[0] - w[0], a[1] - w[1]);
            wd -= cone.rise(a[0] + 2.0 * w[0], a[1] + 2.0 * w[1]);
        }
        let (has_a, has_b) = (ra < 1e17, rb < 1e17);
        let free = has_a & has_b;
        let curvature = choose(free, curvature(wa, wb, wc, wd, rc < 1e17, rd < 1e17), 0.0);
        // Between a node and a wall there is only the node.
        let lo = choose(has_a, 0.0, 1.0);
        let hi = choose(has_b, 1.0, lo);
        let base = choose(has_a, wa, wb);
        let rise = choose(free, wb - wa, 0.0);

        let here = Quadratic::new(m, a, w);
        let (ca, cb) = (Quadratic::new(at_a, a, w), Quadratic::new(at_b, a, w));
        let far = Quadratic::new(cone.m0, [cone.v[0] + a[0], cone.v[1] + a[1]], w);

        // The first-order foot, see `segment`.
        let d = choose(free, slope, 0.0);
        let middle = here.1 / here.2;
        let across = greatest(here.0 - here.1 * middle, 0.0);
        let steep = here.2 * greatest(here.2 - d * d, 1e-12 * here.2);
        let phi = -d * across * inverse_root(greatest(across * steep, 1e-30));
        let mut t = greatest(lo, least(hi, phi - middle));
        for _ in 0..NEWTON_STEPS {
            let [_, p0, h0] = here.jet(t);
            let [va, pa, ha] = ca.jet(t);
            let [vb, pb, hb] = cb.jet(t);
            let (mut pc, mut hc) = (0.0, 0.0);
            if IN_CONE {
                let [_, first, second] = far.jet(t);
                (pc, hc) = (cone.on * first, cone.on * second);
            }
            let first = pc + rise - 0.5 * (1.0 - 2.0 * t) * curvature
                + 0.5 * (p0 + pa + t * (pb - pa) + vb - va);
            let second = hc + curvature + 0.5 * (h0 + ha + t * (hb - ha) + 2.0 * (pb - pa));
            let step = choose(second > 1e-6, first / second, 0.0);
            t = greatest(lo, least(hi, t - greatest(-0.3, least(0.3, step))));
        }
        let length = 0.5 * (here.root(t) + (1.0 - t) * ca.root(t) + t * cb.root(t));
        let bend = greatest(-0.5 * length, least(0.5 * length, 0.5 * t * (1.0 - t) * curvature));
        let mut rho = base + t * rise + length - bend;
        if IN_CONE {
            rho += cone.rise(a[0] + t * w[0], a[1] + t * w[1]);
        }
        (t, rho)
    }
}

/// Second difference along the ring at the segment between `a` and `b`: the mean of those at both, limited (MC) so that
/// a kink does not bend what is straight.
#[inline(always)]
fn curvature(a: f32, b: f32, before: f32, after: f32, has_before: bool, has_after: bool) -> f32 {
    let (at_a, at_b) = (b - 2.0 * a + before, after - 2.0 * b + a);
    let size = least(0.5 * (at_a + at_b).abs(), 2.0 * least(at_a.abs(), at_b.abs()));
    let limited = choose(at_a * at_b > 0.0, choose(at_a > 0.0, size, -size), 0.0);
    let single = choose(has_before, at_a, choose(has_after, at_b, 0.0));
    choose(has_before & has_after, limited, single)
}

#[inline(always)]
fn choose3(yes: bool, a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [choose(yes, a[0], b[0]), choose(yes, a[1], b[1]), choose(yes, a[2], b[2])]
}
