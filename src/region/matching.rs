//! Which regions are alike, on two surfaces or on one.

use serde::Serialize;

use super::Signature;
use crate::error::{Error, Result};

/// Two regions that were matched.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Match {
    /// The region of the first surface.
    pub first: usize,
    /// The region of the second surface; of one surface the one with the larger number.
    pub second: usize,
    /// How unlike they are, 0 to 1: [`Signature::distance`], or [`Signature::sized_distance`] where size counts.
    pub distance: f64,
    /// Size of the second as a multiple of the first's.
    pub size_ratio: f64,
    /// Whether each is the most similar to the other of all; else a more similar one has a better match.
    pub mutual: bool,
}

/// Matches regions of two surfaces: the two most alike first, then the two most alike of the others, until one surface
/// has none left. With `sized`, size counts as well as shape. Regions in which nothing varies, such as those of one node, are left out.
///
/// # Cost
/// Some 50 ns and 24 bytes for each pair.
///
/// # Errors
/// [`Error::Argument`] for more than 16 million pairs.
pub fn match_regions(first: &[Signature], second: &[Signature], sized: bool) -> Result<Vec<Match>> {
    let pairs = (0..first.len()).flat_map(|i| (0..second.len()).map(move |j| (i, j)));
    let offset = first.len();
    greedy(first, second, pairs, |j| offset + j, sized)
}

/// Matches regions of one surface with each other, as [`match_regions`].
///
/// # Errors
/// As [`match_regions`].
pub fn match_regions_within(regions: &[Signature], sized: bool) -> Result<Vec<Match>> {
    let count = regions.len();
    let pairs = (0..count).flat_map(|i| (i + 1..count).map(move |j| (i, j)));
    greedy(regions, regions, pairs, |j| j, sized)
}

/// Takes pairs in order of their distance, ties by number, as long as both are free. `slot` numbers the regions of the
/// second surface apart from those of the first, if they are others.
fn greedy(
    first: &[Signature],
    second: &[Signature],
    pairs: impl Iterator<Item = (usize, usize)>,
    slot: impl Fn(usize) -> usize,
    sized: bool,
) -> Result<Vec<Match>> {
    const MOST_PAIRS: usize = 1 << 24;
    if first.len().saturating_mul(second.len()) > MOST_PAIRS {
        return Err(Error::argument(
            "the number of regions",
            format!("{} and {}", first.len(), second.len()),
            format!("so few that there are at most {MOST_PAIRS} pairs"),
        )
        .advise("segment more coarsely"));
    }
    let distance = if sized { Signature::sized_distance } else { Signature::distance };
    // In a region of one node, or of none, nothing varies: it is like none.
    let varies = |signature: &Signature| signature.eigenvalues[0] > 0.0;
    let pairs = pairs.filter(|&(i, j)| varies(&first[i]) && varies(&second[j]));
    let mut pairs: Vec<_> = pairs.map(|(i, j)| (distance(&first[i], &second[j]), i, j)).collect();
    pairs.sort_by(|a, b| a.0.total_cmp(&b.0).then((a.1, a.2).cmp(&(b.1, b.2))));
    let mut states = vec![State::default(); first.len() + second.len()];
    let mut found = Vec::new();
    for (distance, i, j) in pairs {
        let (a, b) = (states[i], states[slot(j)]);
        if !a.taken && !b.taken {
            let mutual = !a.seen && !b.seen;
            let size_ratio = second[j].size / first[i].size;
            found.push(Match { first: i, second: j, distance, size_ratio, mutual });
            states[i].taken = true;
            states[slot(j)].taken = true;
        }
        states[i].seen = true;
        states[slot(j)].seen = true;
    }
    Ok(found)
}

/// What has become of a region so far.
#[derive(Clone, Copy, Default)]
struct State {
    /// It was in a pair.
    seen: bool,
    /// It has its match.
    taken: bool,
}

#[cfg(test)]
mod tests {
    use super::*;

    fn regions(numbers: &[f64]) -> Vec<Signature> {
        let of = |&x: &f64| Signature { eigenvalues: [x * x, x, 0.0, 0.0], size: x };
        numbers.iter().map(of).collect()
    }

    #[test]
    fn regions_of_one_node_are_like_none() {
        let mut regions = regions(&[1.0, 2.0, 3.0, 4.0]);
        regions[1].eigenvalues = [0.0; 4];
        regions[2].eigenvalues = [0.0; 4];
        assert_eq!(pairs(&match_regions_within(&regions, false).unwrap()), [(0, 3, true)]);
    }

    fn pairs(found: &[Match]) -> Vec<(usize, usize, bool)> {
        found.iter().map(|m| (m.first, m.second, m.mutual)).collect()
    }

    #[test]
    fn the_most_alike_come_first_and_each_is_used_once() {
        let (a, b) = (regions(&[100.0, 9.0, 1.0]), regions(&[1.1, 100.0, 120.0]));
        let found = match_regions(&a, &b, false).unwrap();
        assert_eq!(pairs(&found), [(0, 1, true), (2, 0, true), (1, 2, false)]);
        assert_eq!(found[0].distance, 0.0);
        assert!((found[1].size_ratio - 1.1).abs() < 1e-12);
        assert!(match_regions(&a, &[], false).unwrap().is_empty());
    }

    #[test]
    fn within_one_surface_nothing_matches_itself() {
        let found = match_regions_within(&regions(&[5.0, 1.0, 5.0, 1.2, 70.0]), false).unwrap();
        assert_eq!(pairs(&found), [(0, 2, true), (1, 3, true)]);
    }

    #[test]
    fn size_counts_if_asked_for() {
        let mut b = regions(&[4.0, 4.4]);
        b[0].size = 400.0;
        let a = regions(&[4.0]);
        assert_eq!(match_regions(&a, &b, false).unwrap()[0].second, 0);
        assert_eq!(match_regions(&a, &b, true).unwrap()[0].second, 1);
    }

    #[test]
    fn too_many_pairs_are_refused() {
        let many = vec![Signature::default(); 5000];
        assert!(match_regions(&many, &many, false).is_err());
        // Of regions without nodes there is nothing to match.
        assert!(match_regions_within(&many[..4], true).unwrap().is_empty());
    }
}
