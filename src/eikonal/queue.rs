//! The tiles that wait to be solved.

use super::field::Tiling;
use super::sides::neighbours;

/// One in so many of the waiting tiles may be taken at once, however far apart their keys are. At ratio 400, where
/// keys lie far apart, a round would else have 9 tiles of the 220 that wait: two threads took 34 ms, with a sixth of them 32,
/// one thread 50 and 51; with a fourth 53, and random speeds took 4 % longer.
const SHARE: usize = 6;

/// Tiles with keys, of which the least are taken.
#[derive(Debug)]
pub(super) struct Queue {
    /// The tiles that wait, in any order, and for each the least value that may still change it. Side by side, since
    /// all keys are looked at in every round.
    tiles: Vec<u32>,
    keys: Vec<f32>,
    entries: Vec<Entry>,
}

/// What is known of a tile.
#[derive(Clone, Copy, Debug)]
struct Entry {
    /// Where it stands among those that wait.
    place: u32,
    /// Number of the round that last took the tile or one of its neighbours.
    taken: u32,
    /// The sides that have news, one bit each in the order of [`SIDES`](super::sides::SIDES), and the one that has the least.
    sides: u16,
    first: u8,
}

impl Entry {
    /// The place of a tile that does not wait.
    const NOWHERE: u32 = u32::MAX;
    const NEW: Self = Self { place: Self::NOWHERE, taken: 0, sides: 0, first: 0 };
}

impl Queue {
    pub(super) fn new(tiles: usize) -> Self {
        Self { tiles: Vec::new(), keys: Vec::new(), entries: vec![Entry::NEW; tiles] }
    }

    pub(super) fn is_empty(&self) -> bool {
        self.tiles.is_empty()
    }

    /// Forgets all, where only the given tiles and those that wait were taken, woken or lie beside one that was.
    pub(super) fn clear(&mut self, tiles: &[usize]) {
        for tile in self.tiles.drain(..) {
            self.entries[tile as usize] = Entry::NEW;
        }
        self.keys.clear();
        tiles.iter().for_each(|&tile| self.entries[tile] = Entry::NEW);
    }

    /// News of value `key` from the neighbour `side`.
    pub(super) fn wake(&mut self, tile: usize, key: f32, side: usize) {
        let entry = &mut self.entries[tile];
        if entry.place == Entry::NOWHERE {
            (entry.place, entry.sides) = (self.tiles.len() as u32, 0);
            self.tiles.push(tile as u32);
            self.keys.push(f32::INFINITY);
        }
        entry.sides |= 1 << side;
        let least = &mut self.keys[entry.place as usize];
        if key < *least {
            *least = key;
            entry.first = side as u8;
        }
    }

    pub(super) fn least_key(&self) -> f32 {
        // Keys are not negative, so that their bits are in order; the minimum of integers is taken many at a time.
        let infinity = f32::INFINITY.to_bits();
        f32::from_bits(self.keys.iter().map(|key| key.to_bits()).fold(infinity, u32::min))
    }

    /// Up to which key tiles are to be taken next: `window` above the least, or farther where fewer than one in [`SHARE`]
    /// of those that wait lie within that.
    pub(super) fn horizon(&self, window: f32) -> f32 {
        let limit = self.least_key() + window;
        let least = self.keys.len() / SHARE;
        let within = self.keys.iter().filter(|&&key| key <= limit).count();
        if within >= least {
            return limit;
        }
        *self.keys.clone().select_nth_unstable_by(least, f32::total_cmp).1
    }

    /// Takes the waiting tiles with keys up to `limit` that do not touch, lowest key first, and gives them, as the bits of
    /// [`Job`]s, in order of place.
    pub(super) fn take(&mut self, tiling: &Tiling, limit: f32, round: u32, taken: &mut Vec<u64>) {
        let waiting = self.keys.iter().zip(&self.tiles).filter(|&(&key, _)| key <= limit);
        let ranked = waiting.map(|(key, &tile)| u64::from(key.to_bits()) << 32 | u64::from(tile));
        let mut candidates: Vec<u64> = ranked.collect();
        candidates.sort_unstable();
        for candidate in candidates {
            let tile = candidate as u32;
            let Entry { taken: last, sides, first, .. } = self.entries[tile as usize];
            if last == round {
                continue;
            }
            taken.push(Job { tile, sides, first }.to_bits());
            self.remove(tile as usize);
            for (_, n) in neighbours(tiling, tile as usize) {
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
pub(super) struct Job {
    pub(super) tile: u32,
    /// The sides that have news, and the one with the least, see [`Entry`].
    pub(super) sides: u16,
    pub(super) first: u8,
}

impl Job {
    /// The tile in the upper half, so that bits are in its order.
    pub(super) fn to_bits(self) -> u64 {
        u64::from(self.tile) << 32 | u64::from(self.sides) << 16 | u64::from(self.first)
    }

    pub(super) fn from_bits(bits: u64) -> Self {
        Self { tile: (bits >> 32) as u32, sides: (bits >> 16) as u16, first: bits as u8 }
    }
}
