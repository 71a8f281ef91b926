//! Joining of neighbours that are alike.

use super::{Level, Neighbours, Segmentation, signatures};
use crate::control::Control;
use crate::error::{Error, Result};
use crate::grid::tiling::wrap;
use crate::surface::Surface;

impl Segmentation {
    /// Joins neighbours on the last level that have one parent and whose signatures differ by at most `tolerance`, see
    /// [`Signature::distance`](super::Signature::distance): 0 for none, 1 for all. In each round the most alike pairs come first, each
    /// region in one of them; then the signatures are measured again, until no pair is as alike. What is joined keeps the seed that was
    /// found first.
    ///
    /// # Cost
    /// That of [`signatures`] in each round: one and about the logarithm of how many are joined to one.
    ///
    /// # Errors
    /// A tolerance that is not between 0 and 1; a surface of another size; cancelled.
    pub fn merge_similar(
        &mut self,
        surface: &dyn Surface,
        tolerance: f64,
        control: &Control,
    ) -> Result<()> {
        if !(0.0..=1.0).contains(&tolerance) {
            return Err(Error::argument("the tolerance for merging", tolerance, "between 0 and 1"));
        }
        let Some(level) = self.levels.last_mut() else { return Ok(()) };
        loop {
            control.report("merging", 0.0);
            let found = signatures(surface, &level.labels, Neighbours::Surface, control)?;
            let dissimilarity = |[a, b]: [u32; 2]| found[a as usize].distance(&found[b as usize]);
            let mut pairs: Vec<_> = level
                .siblings(self.cols, surface.periodic())
                .into_iter()
                .map(|pair| (dissimilarity(pair), pair))
                .filter(|(dissimilarity, _)| *dissimilarity <= tolerance)
                .collect();
            pairs.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            if pairs.is_empty() {
                return Ok(());
            }
            level.join(pairs.into_iter().map(|(_, pair)| pair));
        }
    }
}

impl Level {
    /// Pairs of regions with one parent that share a side of a cell, the lower first.
    fn siblings(&self, cols: usize, [across, down]: [bool; 2]) -> Vec<[u32; 2]> {
        let rows = self.labels.len() / cols;
        let mut pairs = Vec::new();
        for (index, label) in self.labels.iter().enumerate() {
            let (col, row) = (index % cols, index / cols);
            let east = wrap(col as isize + 1, cols, across).map(|col| row * cols + col);
            let south = wrap(row as isize + 1, rows, down).map(|row| row * cols + col);
            for other in [east, south].into_iter().flatten() {
                if let (Some(a), Some(b)) = (*label, self.labels[other])
                    && a != b
                    && self.regions[a as usize].parent == self.regions[b as usize].parent
                {
                    pairs.push([a.min(b), a.max(b)]);
                }
            }
        }
        pairs.sort_unstable();
        pairs.dedup();
        pairs
    }

    /// Makes one region of each pair, but for those with a region that is in an earlier one.
    fn join(&mut self, pairs: impl Iterator<Item = [u32; 2]>) {
        let mut to: Vec<u32> = (0..self.regions.len() as u32).collect();
        let mut paired = vec![false; to.len()];
        for [a, b] in pairs {
            if !paired[a as usize] && !paired[b as usize] {
                paired[a as usize] = true;
                paired[b as usize] = true;
                to[b as usize] = a;
            }
        }
        let is_kept = |region: usize| to[region] as usize == region;
        let mut number = vec![0; to.len()];
        let kept: Vec<usize> = (0..to.len()).filter(|&region| is_kept(region)).collect();
        for (new, &old) in (0..).zip(&kept) {
            number[old] = new;
        }
        self.regions = kept.iter().map(|&region| self.regions[region]).collect();
        for label in self.labels.iter_mut().flatten() {
            *label = number[to[*label as usize] as usize];
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::{DVec2, DVec3};

    use super::*;
    use crate::region::Region;
    use crate::surface::{Jet, SurfaceJet};

    /// Flat in the west, waves in the east.
    struct Half;

    impl Surface for Half {
        fn cols(&self) -> usize {
            60
        }

        fn rows(&self) -> usize {
            20
        }

        fn jet(&self, at: DVec2) -> Jet {
            let x = at.x - 29.5;
            let bend = if x > 0.0 { x.sin() } else { 0.0 };
            Jet::Space(SurfaceJet {
                point: DVec3::new(at.x, -at.y, bend),
                first: [DVec3::X, -DVec3::Y],
                second: [DVec3::Z * bend, DVec3::ZERO, DVec3::ZERO],
            })
        }
    }

    /// Six regions of ten columns.
    fn strips(parents: [Option<u32>; 6]) -> Segmentation {
        let labels = (0..60 * 20).map(|index| Some((index % 60 / 10) as u32)).collect();
        let region = |i: usize| Region { seed: [10 * i + 5, 10], parent: parents[i], epsilon: 1.0 };
        let level = Level { labels, regions: (0..6).map(region).collect() };
        Segmentation { cols: 60, rows: 20, levels: vec![level] }
    }

    #[test]
    fn alike_neighbours_are_joined_and_others_are_not() {
        let merged = |parents, tolerance| {
            let mut cut = strips(parents);
            cut.merge_similar(&Half, tolerance, &Control::default()).unwrap();
            cut.levels.remove(0)
        };
        let level = merged([None; 6], 0.3);
        let west = level.labels[..30].iter().all(|label| *label == Some(0));
        assert!(west && level.regions.len() < 4 && level.regions.len() > 1, "{:?}", level.regions);
        assert_eq!(level.regions[0].seed, [5, 10]);
        assert_eq!(merged([None; 6], 1.0).regions.len(), 1);
        let families = [Some(0), Some(1), Some(1), Some(2), Some(2), Some(2)];
        let level = merged(families, 1.0);
        let parents: Vec<_> = level.regions.iter().map(|region| region.parent).collect();
        assert_eq!(parents, [Some(0), Some(1), Some(2)]);
        assert!(strips([None; 6]).merge_similar(&Half, 1.5, &Control::default()).is_err());
    }
}
