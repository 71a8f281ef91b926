//! Surfaces made of curves.

use glam::{DVec3, DVec4, Vec4Swizzles};

use super::curve::{inserted, interpolated, interpolating, ring, ring_knots};
use super::{Knots, NurbsCurve, NurbsSurface, SMALL};
use crate::error::{Error, Location, Result};

impl NurbsSurface {
    /// The surface that a profile makes when it turns about the line through `origin` along `axis`, exactly (The NURBS Book,
    /// algorithm A8.1).
    ///
    /// The first parameter goes round, counter-clockwise as seen with the axis pointing to the viewer, and is closed; the second is the
    /// profile's. The normal points away from the axis where the profile runs against it. Where the profile touches the axis, the surface
    /// has a pole.
    ///
    /// # Errors
    /// [`Error::Argument`] for an axis without direction, and as [`new`](Self::new): a profile that lies on the axis.
    pub fn revolve(profile: &NurbsCurve, origin: DVec3, axis: DVec3) -> Result<Self> {
        let axis =
            axis.try_normalize().ok_or_else(|| Error::argument("the axis", axis, "a direction"))?;
        let net = profile.net.iter().flat_map(|&p| turned_about(p, origin, axis)).collect();
        Self::from_net([ring_knots()?, profile.knots.clone()], [true, profile.closed], net)
    }

    /// The surface of straight lines between points of equal parameter on two curves of one degree: the first parameter runs along
    /// the curves, the second from `a` to `b`.
    ///
    /// # Errors
    /// As [`loft`](Self::loft).
    pub fn ruled(a: &NurbsCurve, b: &NurbsCurve) -> Result<Self> {
        Self::loft(&[a.clone(), b.clone()], 1)
    }

    /// The surface through sections, all of one degree: the first parameter runs along the sections, the second from the first
    /// to the last, with splines of `degree` in proportion to the mean distance of their control points (The NURBS Book, section
    /// 10.3). Closed along the sections if all are closed.
    ///
    /// # Errors
    /// [`Error::Argument`] for fewer than `degree + 1` sections, sections of different degree, or that coincide, and as
    /// [`new`](Self::new).
    pub fn loft(sections: &[NurbsCurve], degree: usize) -> Result<Self> {
        let (along, lines) = on_common_knots(sections)?;
        let point = |p: DVec4| p.xyz() / p.w;
        let chords = lines.windows(2).map(|pair| {
            let sum: f64 =
                pair[0].iter().zip(&pair[1]).map(|(p, q)| point(*p).distance(point(*q))).sum();
            sum / pair[0].len() as f64
        });
        let (across, places) = interpolating(degree, chords)?;
        let columns: Vec<Vec<DVec4>> = (0..along.controls())
            .map(|i| interpolated(&across, &places, lines.iter().map(|line| line[i]).collect()))
            .collect();
        let net = (0..across.controls())
            .flat_map(|k| columns.iter().map(move |column| column[k]))
            .collect();
        Self::from_net([along, across], [sections.iter().all(|section| section.closed), false], net)
    }

    /// The surface that a section makes when it is carried along a trajectory without turning about it (rotation-minimising frames; Wang,
    /// Jüttler, Zheng and Liu, Computation of Rotation Minimizing Frames, 2008): a cubic loft through the section at
    /// `stations` places.
    ///
    /// The section is given in the frame of a traveller: x to the right, y up, the trajectory through its origin. `up` is the direction up
    /// at the beginning. The first parameter is the section's, the second runs along the trajectory. The normal points
    /// outwards if the section runs counter-clockwise.
    ///
    /// # Errors
    /// [`Error::Argument`] for fewer than 4 stations, a trajectory that stands still, or that begins along `up`, and as
    /// [`new`](Self::new).
    pub fn sweep(
        section: &NurbsCurve,
        trajectory: &NurbsCurve,
        up: DVec3,
        stations: usize,
    ) -> Result<Self> {
        let most = Knots::MAX_CONTROLS / section.net.len();
        if !(4..=most).contains(&stations) {
            return Err(Error::argument(
                "the number of stations of a sweep",
                stations,
                format!("between 4 and {most}"),
            ));
        }
        let sections: Vec<NurbsCurve> = frames(trajectory, up, stations)?
            .into_iter()
            .map(|frame| {
                let net = section.net.iter().map(|&p| frame.to_space(p)).collect();
                NurbsCurve { net, ..section.clone() }
            })
            .collect();
        Self::loft(&sections, 3)
    }
}

/// Control points of the circle that a control point makes when it turns about an axis.
fn turned_about(p: DVec4, origin: DVec3, axis: DVec3) -> impl Iterator<Item = DVec4> {
    let arm = p.xyz() / p.w - origin;
    let out = arm.reject_from_normalized(axis);
    let circle = ring(origin + arm - out, out, axis.cross(out));
    circle.into_iter().map(move |q| (q.xyz() * q.w).extend(q.w) * p.w)
}

/// A point of a trajectory, with unit vectors along it and up.
#[derive(Clone, Copy)]
struct Frame {
    at: DVec3,
    along: DVec3,
    up: DVec3,
}

/// Frames at equal steps of the parameter, each from the one before by two reflections.
fn frames(trajectory: &NurbsCurve, up: DVec3, count: usize) -> Result<Vec<Frame>> {
    let [from, to] = trajectory.domain();
    let mut frames: Vec<Frame> = Vec::with_capacity(count);
    for k in 0..count {
        let u = from + (to - from) * k as f64 / (count - 1) as f64;
        let at = trajectory.point(u);
        let along = trajectory.tangent(u).try_normalize();
        let along = along.ok_or_else(|| {
            Error::argument("the speed of the trajectory", 0, "above 0").at(Location::Space(at))
        })?;
        let carried = match frames.last() {
            Some(last) => {
                let middle = last.reflected(at - last.at);
                middle.reflected(along - middle.along).up
            }
            None => up,
        };
        let up = carried.reject_from_normalized(along);
        if up.length() <= SMALL * carried.length() {
            return Err(Error::argument(
                "the beginning of the trajectory",
                format!("along {carried}, which is to be up"),
                "in another direction",
            ));
        }
        let up = up.normalize();
        frames.push(Frame { at, along, up });
    }
    Ok(frames)
}

impl Frame {
    /// A control point `(w x, w y, w z, w)` to the right, up and along, in space.
    fn to_space(self, p: DVec4) -> DVec4 {
        let Self { at, along, up } = self;
        let right = along.cross(up);
        (right * p.x + up * p.y + along * p.z + at * p.w).extend(p.w)
    }

    /// Both vectors reflected at the plane across `by`.
    fn reflected(self, by: DVec3) -> Self {
        let Some(normal) = by.try_normalize() else { return self };
        let [along, up] = [self.along, self.up].map(|v| v - 2.0 * v.dot(normal) * normal);
        Self { along, up, ..self }
    }
}

/// The curves on the knots of all of them, over 0 to 1.
fn on_common_knots(curves: &[NurbsCurve]) -> Result<(Knots, Vec<Vec<DVec4>>)> {
    let degree = curves.first().map_or(0, |curve| curve.knots.degree());
    if let Some(other) = curves.iter().find(|curve| curve.knots.degree() != degree) {
        return Err(Error::argument(
            "the degree of a section",
            other.knots.degree(),
            format!("{degree}, that of the first"),
        ));
    }
    let mut lines = Vec::with_capacity(curves.len());
    for curve in curves {
        lines.push((over_unit(&curve.knots)?, curve.net.clone()));
    }
    // Each knot as often as it comes in any of them; those that all but coincide are one.
    let all = lines.iter().fold(Vec::new(), |all, (knots, _)| union(&all, knots.as_slice()));
    for (knots, net) in &mut lines {
        for &u in &all {
            let count = |of: &[f64]| of.iter().filter(|&&knot| is_near(knot, u)).count();
            for _ in count(knots.as_slice())..count(&all) {
                let (finer, shares) = knots.inserted(u)?;
                (*knots, *net) = (finer, inserted(net, &shares));
            }
        }
    }
    let knots = lines.first().map(|(knots, _)| knots.clone());
    let knots =
        knots.ok_or_else(|| Error::argument("the number of sections of a loft", 0, "1 or more"))?;
    Ok((knots, lines.into_iter().map(|(_, net)| net).collect()))
}

fn over_unit(knots: &Knots) -> Result<Knots> {
    let [from, to] = knots.domain();
    let unit = |u: &f64| if *u == to { 1.0 } else { (u - from) / (to - from) };
    Knots::new(knots.degree(), knots.as_slice().iter().map(unit).collect())
}

fn is_near(a: f64, b: f64) -> bool {
    (a - b).abs() <= SMALL
}

/// Two ascending lists as one; what is in both, or all but in both, once.
fn union(a: &[f64], b: &[f64]) -> Vec<f64> {
    let (mut a, mut b) = (a.iter().copied().peekable(), b.iter().copied().peekable());
    let mut all = Vec::new();
    loop {
        let next = match (a.peek(), b.peek()) {
            (Some(&u), Some(&v)) if is_near(u, v) => b.next().and(a.next()),
            (Some(&u), Some(&v)) if u > v => b.next(),
            (Some(_), _) => a.next(),
            (None, _) => b.next(),
        };
        match next {
            Some(u) => all.push(u),
            None => return all,
        }
    }
}
