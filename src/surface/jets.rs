//! Jets of many nodes of any surface, laid out for wide registers.

use glam::{DVec2, DVec3};

use super::SurfaceJet;
use super::bspline::block::{BLOCK, JetBlock, Lanes};
use super::parametric::on_ground;

/// Derivatives at [`BLOCK`] nodes: those of a [`SurfaceJet`] side by side, without the points.
#[derive(Clone, Debug, Default)]
pub(crate) struct SurfaceJets {
    first: [[Lanes; 3]; 2],
    second: [[Lanes; 3]; 3],
}

impl SurfaceJets {
    /// Takes the jets of some nodes, at most [`BLOCK`]; what is there of others means nothing.
    pub(crate) fn load(&mut self, jets: &[SurfaceJet]) {
        for (i, jet) in jets.iter().enumerate().take(BLOCK) {
            self.set(i, jet);
        }
    }

    /// Takes the jets of a row of a block of heights, whose nodes are `spacing` metres apart.
    pub(crate) fn load_heights(&mut self, jets: &JetBlock, row: usize, spacing: DVec2) {
        for i in 0..BLOCK {
            self.set(i, &on_ground(DVec2::ZERO, spacing, &jets.jet(row, i)));
        }
    }

    #[inline(always)]
    fn set(&mut self, i: usize, jet: &SurfaceJet) {
        let set = |lanes: &mut [Lanes; 3], s: DVec3| {
            [lanes[0][i], lanes[1][i], lanes[2][i]] = s.to_array();
        };
        self.first.iter_mut().zip(jet.first).for_each(|(lanes, s)| set(lanes, s));
        self.second.iter_mut().zip(jet.second).for_each(|(lanes, s)| set(lanes, s));
    }

    /// The jet of node `i`, with the point at the origin.
    #[inline(always)]
    pub(crate) fn get(&self, i: usize) -> SurfaceJet {
        let at = |lanes: &[Lanes; 3]| DVec3::new(lanes[0][i], lanes[1][i], lanes[2][i]);
        let ([a, b], [aa, ab, bb]) = (&self.first, &self.second);
        SurfaceJet { point: DVec3::ZERO, first: [at(a), at(b)], second: [at(aa), at(ab), at(bb)] }
    }
}
