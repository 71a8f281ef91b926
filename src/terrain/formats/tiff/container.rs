//! The file: its header, and unsigned integers at an offset.

use super::error::{TiffResult, damaged};

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
    pub(super) big: bool,
    /// Where the first directory begins.
    pub(super) first: u64,
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

    /// `length` bytes from byte `at` on; `None` if the file ends before.
    pub(super) fn slice(self, at: u64, length: u64) -> Option<&'a [u8]> {
        let start = usize::try_from(at).ok()?;
        let end = start.checked_add(usize::try_from(length).ok()?)?;
        self.bytes.get(start..end)
    }

    /// The unsigned integer of `size` bytes at byte `at`.
    pub(super) fn uint(self, at: u64, size: u64) -> Option<u64> {
        Some(self.to_uint(self.slice(at, size)?))
    }

    /// The unsigned integer that `bytes` are.
    pub(super) fn to_uint(self, bytes: &[u8]) -> u64 {
        let push = |value: u64, byte: &u8| value << 8 | u64::from(*byte);
        if self.big_endian { bytes.iter().fold(0, push) } else { bytes.iter().rev().fold(0, push) }
    }
}
