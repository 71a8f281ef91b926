//! The active set: the tiles that wait to be solved.

use crate::grid::tiling::Tiling;

/// At least one in so many of the waiting tiles may be taken at once, however far apart their keys are. At ratio 400, where
/// keys lie far apart, a round would otherwise have 9 tiles of the 220 that wait: two threads took 34 ms, with a sixth of them 32,
/// one thread 50 and 51; with a fourth 53, and random speeds took 4 % longer.
const SHARE: usize = 6;

/// In place of the direction to a neighbour: the tile itself.
pub(crate) const ITSELF: usize = 8;

/// Tiles with keys, of which the least are taken.
#[derive(Debug)]
pub(crate) struct ActiveSet {
    /// The tiles that wait, in any order, and for each its key: the least value that may still change it. In a vector of their own, since
    /// all keys are read in every round.
    tiles: Vec<u32>,
    keys: Vec<f32>,
    entries: Vec<Entry>,
}

/// What is known of a tile.
#[derive(Clone, Copy, Debug)]
struct Entry {
    /// Its index among those that wait.
    place: u32,
    /// Number of the round that last took the tile or one of its neighbours.
    taken: u32,
    /// The directions from which there are changes that it has not taken into account, one bit each as in [`Tiling::neighbours`] and one for
    /// the tile [`ITSELF`]; and the direction of the least of them.
    changed: u16,
    first: u8,
}

impl Entry {
    /// The place of a tile that does not wait.
    const NOWHERE: u32 = u32::MAX;
    const NEW: Self = Self { place: Self::NOWHERE, taken: 0, changed: 0, first: 0 };
}

impl ActiveSet {
    pub(crate) fn new(tiles: usize) -> Self {
        Self { tiles: Vec::new(), keys: Vec::new(), entries: vec![Entry::NEW; tiles] }
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.tiles.is_empty()
    }

    /// Forgets all, provided that all tiles that were ever activated, or are neighbours of one that was taken, are among the given ones or wait.
    pub(crate) fn clear(&mut self, tiles: &[usize]) {
        for tile in self.tiles.drain(..) {
            self.entries[tile as usize] = Entry::NEW;
        }
        self.keys.clear();
        tiles.iter().for_each(|&tile| self.entries[tile] = Entry::NEW);
    }

    /// Activates a tile because values changed, of which `key` is the least, in the neighbour in a direction or in the tile [`ITSELF`].
    pub(crate) fn activate(&mut self, tile: usize, key: f32, direction: usize) {
        let entry = &mut self.entries[tile];
        if entry.place == Entry::NOWHERE {
            (entry.place, entry.changed) = (self.tiles.len() as u32, 0);
            self.tiles.push(tile as u32);
            self.keys.push(f32::INFINITY);
        }
        entry.changed |= 1 << direction;
        let least = &mut self.keys[entry.place as usize];
        if key < *least {
            *least = key;
            entry.first = direction as u8;
        }
    }

    pub(crate) fn least_key(&self) -> f32 {
        // The bits of numbers that are not negative are in the order of the numbers, and a minimum of integers is vectorised.
        let infinity = f32::INFINITY.to_bits();
        f32::from_bits(self.keys.iter().map(|key| key.to_bits()).fold(infinity, u32::min))
    }

    /// Up to which key tiles are to be taken next: `window` above the least, or farther where fewer than one in [`SHARE`]
    /// of those that wait lie within that.
    pub(crate) fn horizon(&self, window: f32) -> f32 {
        let limit = self.least_key() + window;
        let least = self.keys.len() / SHARE;
        let within = self.keys.iter().filter(|&&key| key <= limit).count();
        if within >= least {
            return limit;
        }
        *self.keys.clone().select_nth_unstable_by(least, f32::total_cmp).1
    }

    /// Takes waiting tiles with keys up to `limit`, lowest key first, no two of which are neighbours; appends them to `taken`, as the bits of
    /// [`Job`]s, in the order of their numbers.
    pub(crate) fn take(&mut self, tiling: &Tiling, limit: f32, round: u32, taken: &mut Vec<u64>) {
        let waiting = self.keys.iter().zip(&self.tiles).filter(|&(&key, _)| key <= limit);
        let ranked = waiting.map(|(key, &tile)| u64::from(key.to_bits()) << 32 | u64::from(tile));
        let mut candidates: Vec<u64> = ranked.collect();
        candidates.sort_unstable();
        for candidate in candidates {
            let tile = candidate as u32;
            let Entry { taken: last, changed, first, .. } = self.entries[tile as usize];
            if last == round {
                continue;
            }
            taken.push(Job { tile, changed, first }.to_bits());
            self.remove(tile as usize);
            for (_, n) in tiling.neighbours(tile as usize) {
                self.entries[n].taken = round;
            }
        }
        taken.sort_unstable();
    }

    fn remove(&mut self, tile: usize) {
        let place = std::mem::replace(&mut self.entries[tile].place, Entry::NOWHERE);
        self.tiles.swap_remove(place as usize);
        self.keys.swap_remove(place as usize);
        if let Some(&moved) = self.tiles.get(place as usize) {
            self.entries[moved as usize].place = place;
        }
    }
}

/// A tile to be solved.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Job {
    pub(crate) tile: u32,
    /// Where there are changes, and where the least, as in [`Problem`](crate::eikonal::tile::kernel::Problem).
    pub(crate) changed: u16,
    pub(crate) first: u8,
}

impl Job {
    /// The tile in the upper half, so that the bits are in the order of the tiles.
    pub(crate) fn to_bits(self) -> u64 {
        u64::from(self.tile) << 32 | u64::from(self.changed) << 16 | u64::from(self.first)
    }

    pub(crate) fn from_bits(bits: u64) -> Self {
        Self { tile: (bits >> 32) as u32, changed: (bits >> 16) as u16, first: bits as u8 }
    }
}
