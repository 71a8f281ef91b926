//! Jets of many nodes at once: a block of the grid.

use std::ops::Range;

use glam::{DVec2, DVec3};

use super::bspline::block::HeightBlock;
use super::{Jet, Surface, SurfaceJet};

pub(crate) use super::bspline::block::{BLOCK, Lanes};

/// Nodes of a grid side by side, or the cells to the south-east of them: at most [`SIDE`](Self::SIDE) columns and as many rows.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Block {
    /// Their columns.
    pub cols: Range<usize>,
    /// Their rows.
    pub rows: Range<usize>,
    /// Whether the places meant are the middles of the cells rather than the nodes. Those of the last column and row of a grid that is
    /// not periodic lie beyond it, and mean nothing.
    pub centres: bool,
}

impl Block {
    /// Most columns and most rows.
    pub const SIDE: usize = BLOCK;

    /// The block whose first node is `(col, row)`, as large as the grid of `surface` allows.
    #[must_use]
    pub fn from(surface: &dyn Surface, col: usize, row: usize) -> Self {
        let end = |at: usize, count: usize| count.min(at + BLOCK);
        Self {
            cols: col..end(col, surface.cols()),
            rows: row..end(row, surface.rows()),
            centres: false,
        }
    }

    /// Row and column within the block of each place, and its grid coordinates.
    pub fn places(&self) -> impl Iterator<Item = (usize, usize, DVec2)> + '_ {
        let shift = if self.centres { 0.5 } else { 0.0 };
        self.rows.clone().enumerate().flat_map(move |(j, row)| {
            let at = move |col: usize| DVec2::new(col as f64, row as f64) + shift;
            self.cols.clone().enumerate().map(move |(i, col)| (j, i, at(col)))
        })
    }
}

/// Jets at the nodes of a [`Block`], by row and column within it. All are of one kind, heights or in space.
#[derive(Clone, Debug, Default)]
pub struct JetBlock(Layout);

#[derive(Clone, Debug, Default)]
enum Layout {
    #[default]
    Empty,
    Heights(Box<HeightBlock>),
    /// Row by row.
    Space(Vec<SurfaceJet>),
}

impl JetBlock {
    /// The jet in column `i` of row `j`.
    ///
    /// # Panics
    /// If `i` or `j` is not less than [`Block::SIDE`].
    #[must_use]
    #[inline(always)]
    pub fn get(&self, j: usize, i: usize) -> Jet {
        match &self.0 {
            Layout::Heights(jets) => Jet::Height(jets.jet(j, i)),
            Layout::Space(jets) => Jet::Space(jets[j * BLOCK + i]),
            Layout::Empty => Jet::Space(SurfaceJet::default()),
        }
    }

    /// Gives the node in column `i` of row `j` a jet. A jet of another kind than those it holds replaces them all.
    ///
    /// # Panics
    /// As [`get`](Self::get).
    pub fn set(&mut self, j: usize, i: usize, jet: Jet) {
        match jet {
            Jet::Height(jet) => self.heights_mut().set(j, i, &jet),
            Jet::Space(jet) => self.space_mut()[j * BLOCK + i] = jet,
        }
    }

    /// Heights side by side, if that is what it holds.
    pub(crate) fn heights(&self) -> Option<&HeightBlock> {
        match &self.0 {
            Layout::Heights(jets) => Some(jets),
            _ => None,
        }
    }

    /// Room for heights.
    pub(crate) fn heights_mut(&mut self) -> &mut HeightBlock {
        if !matches!(self.0, Layout::Heights(_)) {
            self.0 = Layout::Heights(Box::default());
        }
        let Layout::Heights(jets) = &mut self.0 else { unreachable!("just made") };
        jets
    }

    /// Room for jets in space, row by row.
    pub(super) fn space_mut(&mut self) -> &mut [SurfaceJet] {
        if !matches!(self.0, Layout::Space(_)) {
            self.0 = Layout::Space(vec![SurfaceJet::default(); BLOCK * BLOCK]);
        }
        let Layout::Space(jets) = &mut self.0 else { unreachable!("just made") };
        jets
    }

    /// Adds the first `count` jets of row `j` in space; the first is at `at`, and a step measures `axes`.
    pub(super) fn add_row_in_space(
        &self,
        j: usize,
        count: usize,
        at: DVec2,
        axes: DVec2,
        row: &mut Vec<SurfaceJet>,
    ) {
        match &self.0 {
            Layout::Heights(jets) => row.extend((0..count).map(|i| {
                let at = at + DVec2::new(i as f64, 0.0);
                jets.jet(j, i).in_space(at, axes)
            })),
            Layout::Space(jets) => row.extend_from_slice(&jets[j * BLOCK..][..count]),
            Layout::Empty => row.resize(row.len() + count, SurfaceJet::default()),
        }
    }
}

/// Derivatives in space at the nodes of a row of a block: those of a [`SurfaceJet`] side by side for wide registers, without
/// the points.
#[derive(Clone, Debug, Default)]
pub(crate) struct SpaceLanes {
    first: [[Lanes; 3]; 2],
    second: [[Lanes; 3]; 3],
}

impl SpaceLanes {
    /// Takes row `j` of a block, where a step measures `axes`; what is there of nodes beyond the grid means nothing.
    pub(crate) fn load(&mut self, jets: &JetBlock, j: usize, axes: DVec2) {
        match &jets.0 {
            Layout::Heights(jets) => {
                for i in 0..BLOCK {
                    self.set(i, &jets.jet(j, i).in_space(DVec2::ZERO, axes));
                }
            }
            Layout::Space(jets) => self.load_row(&jets[j * BLOCK..][..BLOCK]),
            Layout::Empty => {}
        }
    }

    /// Takes the jets of some nodes, at most [`BLOCK`].
    pub(crate) fn load_row(&mut self, jets: &[SurfaceJet]) {
        for (i, jet) in jets.iter().enumerate().take(BLOCK) {
            self.set(i, jet);
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
