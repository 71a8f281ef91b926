//! The tags of an image and their values.

use std::borrow::Cow;

use super::container::Tiff;
use super::error::{TiffResult, damaged};
use crate::error::Error;

/// One image of the file: the entries of its directory, by tag.
pub(crate) struct Directory<'a> {
    pub(super) tiff: Tiff<'a>,
    pub(super) entries: Vec<Entry<'a>>,
    /// Where the next directory begins; 0 if there is none.
    pub(super) next: u64,
}

/// A tag and its values.
pub(super) struct Entry<'a> {
    pub(super) tag: u16,
    /// How a value is stored: the type numbers of *TIFF Revision 6.0*, section 2, and BigTIFF.
    pub(super) kind: u16,
    pub(super) count: u64,
    /// The bytes of the values, or `None` if they lie beyond the end of the file.
    pub(super) values: Option<&'a [u8]>,
}

impl<'a> Directory<'a> {
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

fn wrong_type<T>(tag: u16, kind: u16, expected: &str) -> TiffResult<T> {
    damaged(format!("the type of tag {tag}"), kind, expected)
}
