//! How the bytes of a chunk are compressed.

use std::io::Read;

use super::error::{TiffResult, unsupported};
use crate::error::Remedy;

/// What is done to the bytes of a chunk before storing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Codec {
    None,
    Lzw,
    Deflate,
    PackBits,
    Zstd,
    #[cfg(feature = "lzma")]
    Lzma,
}

impl Codec {
    /// The codec of a number of the tag `Compression`.
    pub(super) fn new(code: u64) -> TiffResult<Self> {
        let name = match code {
            1 => return Ok(Self::None),
            5 => return Ok(Self::Lzw),
            8 | 32946 => return Ok(Self::Deflate),
            32773 => return Ok(Self::PackBits),
            #[cfg(feature = "lzma")]
            34925 => return Ok(Self::Lzma),
            50000 => return Ok(Self::Zstd),
            2..=4 => "CCITT fax (1 bit per sample: a mask, not heights)",
            6 | 7 => "JPEG (lossy: its blocks would show as ridges)",
            34887 => "LERC",
            #[cfg(not(feature = "lzma"))]
            34925 => "LZMA (without the feature `lzma`)",
            50001 => "WebP",
            50002 => "JPEG XL",
            _ => "unknown",
        };
        unsupported(format!("compression {code}, {name}, which is not read"), Remedy::Recompress)
    }

    /// More bytes than this cannot come out of one byte: what a forged size is held against.
    ///
    /// Deflate: 258 bytes from 2 bits, 1032. LZW: strings to 3839 bytes from 12 bits. PackBits: 128 from 2.
    /// Zstandard: a block of 128 KiB from 4 bytes. LZMA: a match of 273 bytes from 14 decisions of .022 bits at least, 7100.
    pub(super) fn most_expansion(self) -> u64 {
        match self {
            Self::None => 1,
            Self::PackBits => 64,
            Self::Deflate => 1032,
            Self::Lzw => 2560,
            Self::Zstd => 32768,
            #[cfg(feature = "lzma")]
            Self::Lzma => 8192,
        }
    }

    /// The first `length` bytes of what was compressed to `stored`; never more, whatever is in there.
    pub(super) fn expand(self, stored: &[u8], length: usize) -> Result<Vec<u8>, String> {
        /// Bytes allocated at once; more, which a damaged file may claim, are allocated as they come.
        const ROOM: usize = 1 << 24;
        let mut bytes = Vec::with_capacity(length.min(ROOM));
        match self {
            Self::None => bytes.extend_from_slice(&stored[..length.min(stored.len())]),
            Self::PackBits => bytes = unpack_bits(stored, length),
            Self::Lzw => bytes = expand_lzw(stored, length)?,
            Self::Deflate => {
                let mut stream = flate2::bufread::ZlibDecoder::new(stored).take(length as u64);
                stream.read_to_end(&mut bytes).map_err(|e| e.to_string())?;
                // One step on, to the checksum at the end of the stream.
                stream.into_inner().read(&mut [0]).map_err(|e| e.to_string())?;
            }
            Self::Zstd => {
                let stream =
                    ruzstd::decoding::StreamingDecoder::new(stored).map_err(|e| e.to_string())?;
                stream.take(length as u64).read_to_end(&mut bytes).map_err(|e| e.to_string())?;
            }
            #[cfg(feature = "lzma")]
            Self::Lzma => {
                let stream = lzma_rust2::XzReader::new_mem_limit(stored, false, LZMA_MEMORY);
                stream.take(length as u64).read_to_end(&mut bytes).map_err(|e| e.to_string())?;
            }
        }
        if bytes.len() < length {
            return Err(format!("{} bytes where {length} are due", bytes.len()));
        }
        Ok(bytes)
    }
}

/// KiB that a decoder of LZMA may take: enough for the largest dictionary that `xz` uses by itself, 64 MiB.
#[cfg(feature = "lzma")]
const LZMA_MEMORY: u32 = 72 << 10;

fn expand_lzw(stored: &[u8], length: usize) -> Result<Vec<u8>, String> {
    use weezl::{BitOrder, LzwStatus, decode::Decoder};

    let mut decoder = Decoder::with_tiff_size_switch(BitOrder::Msb, 8);
    let mut bytes = vec![0; length];
    let (mut read, mut written) = (0, 0);
    while written < length {
        let step = decoder.decode_bytes(&stored[read..], &mut bytes[written..]);
        read += step.consumed_in;
        written += step.consumed_out;
        match step.status.map_err(|e| e.to_string())? {
            LzwStatus::Ok => {}
            LzwStatus::NoProgress | LzwStatus::Done => break,
        }
    }
    bytes.truncate(written);
    Ok(bytes)
}

/// PackBits (TIFF 6.0, section 9): `n ≥ 0` copies `n + 1` bytes, `−127 ≤ n < 0` repeats one `1 − n` times.
fn unpack_bits(stored: &[u8], length: usize) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut rest = stored;
    while let (true, Some((&head, tail))) = (bytes.len() < length, rest.split_first()) {
        rest = match (head as i8, tail) {
            (-128, _) => tail,
            (n @ 0.., _) => {
                let (run, tail) = tail.split_at(tail.len().min(n as usize + 1));
                bytes.extend_from_slice(run);
                tail
            }
            (n, [value, tail @ ..]) => {
                bytes.resize(bytes.len() + (1 - isize::from(n)) as usize, *value);
                tail
            }
            (_, []) => break,
        };
    }
    bytes.truncate(length);
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pack_bits_of_the_specification() {
        // The example of Apple's Technical Note TN1023.
        let stored = [
            0xfe, 0xaa, 0x02, 0x80, 0x00, 0x2a, 0xfd, 0xaa, 0x03, 0x80, 0x00, 0x2a, 0x22, 0xf7,
            0xaa,
        ];
        let bytes = unpack_bits(&stored, 100);
        assert_eq!(bytes.len(), 24);
        assert_eq!(bytes[..7], [0xaa, 0xaa, 0xaa, 0x80, 0x00, 0x2a, 0xaa]);
        assert_eq!(unpack_bits(&stored, 5).len(), 5);
        assert_eq!(unpack_bits(&[0x7f, 1], 100), [1]);
    }
}
