//! How a number is stored.

use half::f16;

use super::error::{TiffResult, damaged, unsupported};
use crate::error::Remedy;

/// How one sample is stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Sample {
    U8,
    I8,
    U16,
    I16,
    U32,
    I32,
    U64,
    I64,
    F16,
    F32,
    F64,
    /// Unsigned, this many bits, packed from the most significant bit on, rows padded to whole bytes.
    Packed(u32),
}

impl Sample {
    pub(super) fn new(bits: u64, format: u64) -> TiffResult<Self> {
        Ok(match (format, bits) {
            (_, 0) => return damaged("BitsPerSample", 0, "1 or more"),
            (1 | 4, 8) => Self::U8,
            (1 | 4, 16) => Self::U16,
            (1 | 4, 32) => Self::U32,
            (1 | 4, 64) => Self::U64,
            (1 | 4, 1..32) => Self::Packed(bits as u32),
            (2, 8) => Self::I8,
            (2, 16) => Self::I16,
            (2, 32) => Self::I32,
            (2, 64) => Self::I64,
            (3, 16) => Self::F16,
            (3, 32) => Self::F32,
            (3, 64) => Self::F64,
            (5 | 6, _) => {
                return unsupported(
                    "the samples are complex numbers, not heights",
                    Remedy::ConvertSamples,
                );
            }
            _ => {
                let found =
                    format!("samples of {bits} bits in sample format {format}, which are not read");
                return unsupported(found, Remedy::ConvertSamples);
            }
        })
    }

    /// Bits of one sample.
    pub(super) fn bits(self) -> usize {
        match self {
            Self::U8 | Self::I8 => 8,
            Self::U16 | Self::I16 | Self::F16 => 16,
            Self::U32 | Self::I32 | Self::F32 => 32,
            Self::U64 | Self::I64 | Self::F64 => 64,
            Self::Packed(bits) => bits as usize,
        }
    }

    /// Whether the samples are floating-point numbers.
    pub(crate) fn is_float(self) -> bool {
        matches!(self, Self::F16 | Self::F32 | Self::F64)
    }

    /// GDAL's name of the type.
    pub(crate) fn name(self) -> String {
        match self {
            Self::Packed(bits) => format!("{bits}-bit unsigned"),
            Self::U8 | Self::U16 | Self::U32 | Self::U64 => format!("uint{}", self.bits()),
            Self::I8 | Self::I16 | Self::I32 | Self::I64 => format!("int{}", self.bits()),
            Self::F16 | Self::F32 | Self::F64 => format!("float{}", self.bits()),
        }
    }

    /// `value` as this type would store it: what a nodata value must be compared as.
    pub(crate) fn round(self, value: f64) -> f64 {
        match self {
            Self::F16 => f16::from_f64(value).to_f64(),
            Self::F32 => f64::from(value as f32),
            _ => value,
        }
    }

    /// Calls `put(i, value)` for every `stride`-th sample of a row of little-endian samples, from the `first`.
    pub(super) fn unpack(
        self,
        row: &[u8],
        first: usize,
        stride: usize,
        mut put: impl FnMut(usize, f64),
    ) {
        macro_rules! each {
            ($type:ty, $to:expr) => {{
                let (samples, _) = row.as_chunks::<{ size_of::<$type>() }>();
                for (i, bytes) in samples.iter().skip(first).step_by(stride).enumerate() {
                    put(i, $to(<$type>::from_le_bytes(*bytes)));
                }
            }};
        }
        match self {
            Self::U8 => each!(u8, f64::from),
            Self::I8 => each!(i8, f64::from),
            Self::U16 => each!(u16, f64::from),
            Self::I16 => each!(i16, f64::from),
            Self::U32 => each!(u32, f64::from),
            Self::I32 => each!(i32, f64::from),
            Self::U64 => each!(u64, |v| v as f64),
            Self::I64 => each!(i64, |v| v as f64),
            Self::F16 => each!(f16, f16::to_f64),
            Self::F32 => each!(f32, f64::from),
            Self::F64 => each!(f64, |v| v),
            Self::Packed(bits) => {
                let bits = bits as usize;
                for (i, sample) in (first..row.len() * 8 / bits).step_by(stride).enumerate() {
                    let bit = |b: usize| u32::from(row[b / 8] >> (7 - b % 8) & 1);
                    let value =
                        (sample * bits..(sample + 1) * bits).fold(0, |v, b| v << 1 | bit(b));
                    put(i, f64::from(value));
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn packed_samples_come_out_most_significant_bit_first() {
        let mut values = Vec::new();
        Sample::Packed(12).unpack(&[0x12, 0x34, 0x56], 0, 1, |_, v| values.push(v));
        assert_eq!(values, [f64::from(0x123), f64::from(0x456)]);
    }
}
