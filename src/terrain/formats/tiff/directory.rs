//! The tags of an image and their values.

use std::borrow::Cow;

use super::container::Tiff;
use super::error::{TiffResult, damaged};
use crate::error::{Error, Location};

/// One image of the file: the entries of its directory, by tag.
pub(crate) struct Directory<'a> {
    pub(super) tiff: Tiff<'a>,
    entries: Vec<Entry<'a>>,
    /// Where the next directory begins; 0 if there is none.
    next: u64,
}

/// A tag and its values.
struct Entry<'a> {
    tag: u16,
    /// How a value is stored: the type numbers of *TIFF Revision 6.0*, section 2, and BigTIFF.
    kind: u16,
    count: u64,
    /// The bytes of the values, or `None` if they lie beyond the end of the file.
    values: Option<&'a [u8]>,
}

impl<'a> Directory<'a> {
    /// The images of the file, in order. A damaged or circular tail ends the list, unless nothing came before.
    pub(crate) fn all(tiff: Tiff<'a>) -> TiffResult<Vec<Self>> {
        /// Most images that are read.
        const MOST: usize = 1000;
        let mut seen = vec![tiff.first];
        let mut list = vec![Self::read(tiff, tiff.first)?];
        let mut entries = 0;
        while let Some(last) = list.last() {
            // Directories that overlap, so that there are more entries than bytes, are forged.
            entries += last.entries.len();
            let next = last.next;
            let ended = next == 0 || seen.contains(&next) || list.len() == MOST;
            if ended || entries > tiff.bytes.len() {
                break;
            }
            let Ok(directory) = Self::read(tiff, next) else { break };
            seen.push(next);
            list.push(directory);
        }
        Ok(list)
    }

    /// The directory that begins at byte `at`.
    fn read(tiff: Tiff<'a>, at: u64) -> TiffResult<Self> {
        let (count_size, entry_size, value_size) = if tiff.big { (8, 20, 8) } else { (2, 12, 4) };
        let table = at.saturating_add(count_size);
        let extent = tiff.uint(at, count_size).and_then(|count| {
            let after = count.checked_mul(entry_size)?.checked_add(table)?;
            tiff.slice(table, after - table)?;
            Some((count, after))
        });
        let Some((count, after)) = extent else {
            let within = format!("within the {} bytes of the file", tiff.bytes.len());
            return Err(Error::argument(
                "the end of the image directory",
                "beyond the file",
                within,
            )
            .at(Location::Byte(at))
            .advise("the file is cut short or damaged")
            .into());
        };
        let entries =
            (0..count).filter_map(|i| Entry::read(tiff, table + i * entry_size)).collect();
        // A file may end right after its last directory: no link is no further image.
        let next = tiff.uint(after, value_size).unwrap_or(0);
        Ok(Self { tiff, entries, next })
    }

    /// The value bytes of a tag with the type and count; `None` if the image does not have it.
    fn values(&self, tag: u16) -> TiffResult<Option<(u16, &'a [u8])>> {
        let Some(entry) = self.entries.iter().find(|e| e.tag == tag) else { return Ok(None) };
        match entry.values {
            Some(values) => Ok(Some((entry.kind, values))),
            None => Err(Error::argument(
                format!("the number of values of tag {tag}"),
                entry.count,
                "no more than the file holds",
            )
            .advise("the file is cut short or damaged")
            .into()),
        }
    }

    /// The unsigned integers of a tag; `None` if the image does not have it.
    pub(crate) fn uints(&self, tag: u16) -> TiffResult<Option<Vec<u64>>> {
        let Some((kind, bytes)) = self.values(tag)? else { return Ok(None) };
        let size = match kind {
            1 | 6 | 7 => 1,
            3 | 8 => 2,
            4 | 9 | 13 => 4,
            16..=18 => 8,
            _ => return wrong_type(tag, kind, "one of whole numbers"),
        };
        Ok(Some(bytes.chunks_exact(size).map(|b| self.tiff.to_uint(b)).collect()))
    }

    /// The first unsigned integer of a tag, or `default` if the image does not have it.
    pub(crate) fn uint(&self, tag: u16, default: u64) -> TiffResult<u64> {
        Ok(self.uints(tag)?.and_then(|v| v.first().copied()).unwrap_or(default))
    }

    /// The floating-point numbers of a tag; empty if the image does not have it.
    pub(crate) fn doubles(&self, tag: u16) -> TiffResult<Vec<f64>> {
        match self.values(tag)? {
            None => Ok(Vec::new()),
            Some((12, bytes)) => {
                Ok(bytes.chunks_exact(8).map(|b| f64::from_bits(self.tiff.to_uint(b))).collect())
            }
            Some((11, bytes)) => Ok(bytes
                .chunks_exact(4)
                .map(|b| f64::from(f32::from_bits(self.tiff.to_uint(b) as u32)))
                .collect()),
            Some((kind, _)) => wrong_type(tag, kind, "one of decimals"),
        }
    }

    /// The bytes of a text without the final NUL; `None` if the image does not have it.
    pub(crate) fn text_bytes(&self, tag: u16) -> TiffResult<Option<&'a [u8]>> {
        Ok(self.values(tag)?.map(|(_, bytes)| {
            let end = bytes.iter().position(|b| *b == 0).unwrap_or(bytes.len());
            &bytes[..end]
        }))
    }

    /// The text of a tag; `None` if the image does not have it.
    pub(crate) fn text(&self, tag: u16) -> TiffResult<Option<Cow<'a, str>>> {
        Ok(self.text_bytes(tag)?.map(String::from_utf8_lossy))
    }
}

impl<'a> Entry<'a> {
    /// The entry at byte `at`; `None` if its type is not known.
    fn read(tiff: Tiff<'a>, at: u64) -> Option<Self> {
        let tag = tiff.uint(at, 2)? as u16;
        let kind = tiff.uint(at + 2, 2)? as u16;
        let size = match kind {
            1 | 2 | 6 | 7 => 1,
            3 | 8 => 2,
            4 | 9 | 11 | 13 => 4,
            5 | 10 | 12 | 16..=18 => 8,
            _ => return None,
        };
        let (count, place, inline) = if tiff.big {
            (tiff.uint(at + 4, 8)?, at + 12, 8)
        } else {
            (tiff.uint(at + 4, 4)?, at + 8, 4)
        };
        let values = count.checked_mul(size).and_then(|length| {
            let from = if length <= inline { place } else { tiff.uint(place, inline)? };
            tiff.slice(from, length)
        });
        Some(Self { tag, kind, count, values })
    }
}

fn wrong_type<T>(tag: u16, kind: u16, expected: &str) -> TiffResult<T> {
    damaged(format!("the type of tag {tag}"), kind, expected)
}
