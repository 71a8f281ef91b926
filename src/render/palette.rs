//! Colours that distinguish regions.

use super::colour::Rgb;

/// Light colours that differ in hue and in brightness; ColorBrewer's Set3 without its greys.
const PALETTE: [Rgb; 10] = [
    Rgb(0x8d, 0xd3, 0xc7),
    Rgb(0xfb, 0x80, 0x72),
    Rgb(0xff, 0xff, 0xb3),
    Rgb(0x80, 0xb1, 0xd3),
    Rgb(0xfd, 0xb4, 0x62),
    Rgb(0xbe, 0xba, 0xda),
    Rgb(0xb3, 0xde, 0x69),
    Rgb(0xbc, 0x80, 0xbd),
    Rgb(0xcc, 0xeb, 0xc5),
    Rgb(0xfc, 0xcd, 0xe5),
];

/// Colours for `regions` regions, given the region of each node (row-major) of a grid of `cols` columns, such that neighbours differ wherever ten colours are enough for the
/// order in which they are given out.
#[must_use]
pub fn contrasting_colours(labels: &[Option<u32>], cols: usize, regions: usize) -> Vec<Rgb> {
    let mut pairs = Vec::new();
    for (node, label) in labels.iter().enumerate() {
        let east = if (node + 1) % cols.max(1) == 0 { None } else { labels.get(node + 1) };
        for other in [east, labels.get(node + cols)].into_iter().flatten() {
            if let (Some(a), Some(b)) = (label, other)
                && a != b
            {
                pairs.extend([(*a, *b), (*b, *a)]);
            }
        }
    }
    pairs.sort_unstable();
    pairs.dedup();
    let mut chosen: Vec<usize> = Vec::with_capacity(regions);
    for region in 0..regions {
        let first = pairs.partition_point(|pair| (pair.0 as usize) < region);
        let neighbours = pairs[first..].iter().take_while(|pair| pair.0 as usize == region);
        let taken: Vec<usize> =
            neighbours.filter_map(|pair| chosen.get(pair.1 as usize).copied()).collect();
        // Begins at another colour each time, or most regions would have the first few.
        let mut colours = (0..PALETTE.len()).map(|i| (region + i) % PALETTE.len());
        let free = colours.find(|colour| !taken.contains(colour));
        chosen.push(free.unwrap_or(region % PALETTE.len()));
    }
    chosen.into_iter().map(|colour| PALETTE[colour]).collect()
}

/// Colour of the regions of a match: the nine most alike pairs have their own, others and the unmatched (`None`) are grey.
#[must_use]
pub fn pair_colour(rank: Option<usize>) -> Rgb {
    const UNMATCHED: Rgb = Rgb(0xc8, 0xc8, 0xc8);
    // The tenth is a grey.
    let colour = rank.and_then(|rank| colorous::TABLEAU10[..9].get(rank));
    colour.map_or(UNMATCHED, |c| Rgb(c.r, c.g, c.b))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn neighbours_differ_in_colour() {
        // Bricks: each touches six others.
        let (cols, rows) = (60, 40);
        let label = |i: usize| {
            let (col, row) = (i % cols, i / cols / 4);
            Some((row * 10 + ((col + 3 * (row % 2)) / 6) % 10) as u32)
        };
        let labels: Vec<_> = (0..cols * rows).map(label).collect();
        let colours = contrasting_colours(&labels, cols, 100);
        let colour = |i: usize| colours[labels[i].unwrap() as usize];
        for i in (0..labels.len() - cols).filter(|i| i % cols + 1 < cols) {
            for other in [i + 1, i + cols] {
                assert!(labels[i] == labels[other] || colour(i) != colour(other));
            }
        }
    }
}
