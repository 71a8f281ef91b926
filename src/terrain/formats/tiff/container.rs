//! The file: its header, and where its directories begin.

use super::directory::{Directory, Entry};
use super::error::{TiffResult, damaged};
use crate::error::{Error, Location};

/// Whether a file that begins with `bytes` is a TIFF or BigTIFF.
pub(crate) fn is_tiff(bytes: &[u8]) -> bool {
    [b"II\x2a\0", b"II\x2b\0", b"MM\0\x2a", b"MM\0\x2b"].iter().any(|m| bytes.starts_with(*m))
}

/// A TIFF or BigTIFF in memory.
#[derive(Clone, Copy)]
pub(crate) struct Tiff<'a> {
    pub(super) bytes: &'a [u8],
    pub(super) big_endian: bool,
    /// BigTIFF: counts and offsets of 64 bits.
    big: bool,
    /// Where the first directory begins.
    first: u64,
}

impl<'a> Tiff<'a> {
    /// Reads the header; [`is_tiff`] has said yes.
    pub(crate) fn new(bytes: &'a [u8]) -> TiffResult<Self> {
        let big_endian = bytes.starts_with(b"MM");
        let mut tiff = Self { bytes, big_endian, big: bytes[2..4].contains(&43), first: 0 };
        let first = if tiff.big { tiff.uint(8, 8) } else { tiff.uint(4, 4) };
        match first {
            Some(first) => tiff.first = first,
            None => return damaged("the TIFF header", "cut short", "8 bytes, or 16 in a BigTIFF"),
        }
        Ok(tiff)
    }

    /// The images of the file, in order. A damaged or circular tail ends the list, unless nothing came before.
    pub(crate) fn directories(self) -> TiffResult<Vec<Directory<'a>>> {
        /// More images than this are not looked at.
        const MOST: usize = 1000;
        let mut seen = vec![self.first];
        let mut list = vec![self.directory(self.first)?];
        let mut entries = 0;
        while let Some(last) = list.last() {
            // Directories that overlap, so that there are more entries than bytes, are forged.
            entries += last.entries.len();
            let next = last.next;
            let ended = next == 0 || seen.contains(&next) || list.len() == MOST;
            if ended || entries > self.bytes.len() {
                break;
            }
            let Ok(directory) = self.directory(next) else { break };
            seen.push(next);
            list.push(directory);
        }
        Ok(list)
    }

    fn directory(self, at: u64) -> TiffResult<Directory<'a>> {
        let (count_size, entry_size, value_size) = if self.big { (8, 20, 8) } else { (2, 12, 4) };
        let table = at.saturating_add(count_size);
        let extent = self.uint(at, count_size).and_then(|count| {
            let after = count.checked_mul(entry_size)?.checked_add(table)?;
            self.slice(table, after - table)?;
            Some((count, after))
        });
        let Some((count, after)) = extent else {
            let within = format!("within the {} bytes of the file", self.bytes.len());
            return Err(Error::argument(
                "the end of the image directory",
                "beyond the file",
                within,
            )
            .at(Location::Byte(at))
            .advise("the file is cut short or damaged")
            .into());
        };
        let entries = (0..count).filter_map(|i| self.entry(table + i * entry_size)).collect();
        // A file may end right after its last directory: no link is no further image.
        let next = self.uint(after, value_size).unwrap_or(0);
        Ok(Directory { tiff: self, entries, next })
    }

    fn entry(self, at: u64) -> Option<Entry<'a>> {
        let tag = self.uint(at, 2)? as u16;
        let kind = self.uint(at + 2, 2)? as u16;
        let size = match kind {
            1 | 2 | 6 | 7 => 1,
            3 | 8 => 2,
            4 | 9 | 11 | 13 => 4,
            5 | 10 | 12 | 16..=18 => 8,
            _ => return None,
        };
        let (count, place, inline) = if self.big {
            (self.uint(at + 4, 8)?, at + 12, 8)
        } else {
            (self.uint(at + 4, 4)?, at + 8, 4)
        };
        let values = count.checked_mul(size).and_then(|length| {
            let from = if length <= inline { place } else { self.uint(place, inline)? };
            self.slice(from, length)
        });
        Some(Entry { tag, kind, count, values })
    }

    /// `length` bytes from byte `at` on; `None` if the file ends before.
    pub(super) fn slice(self, at: u64, length: u64) -> Option<&'a [u8]> {
        let start = usize::try_from(at).ok()?;
        let end = start.checked_add(usize::try_from(length).ok()?)?;
        self.bytes.get(start..end)
    }

    /// The unsigned integer of `size` bytes at byte `at`.
    fn uint(self, at: u64, size: u64) -> Option<u64> {
        Some(self.to_uint(self.slice(at, size)?))
    }

    /// The unsigned integer that `bytes` are.
    pub(super) fn to_uint(self, bytes: &[u8]) -> u64 {
        let push = |value: u64, byte: &u8| value << 8 | u64::from(*byte);
        if self.big_endian { bytes.iter().fold(0, push) } else { bytes.iter().rev().fold(0, push) }
    }
}
