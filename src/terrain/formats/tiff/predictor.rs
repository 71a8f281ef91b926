//! Samples stored as differences, which compress better.

use super::error::{TiffResult, damaged, unsupported};
use super::sample::Sample;
use crate::error::Remedy;

/// What was done to the samples of a row before they were compressed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Predictor {
    None,
    Differences,
    FloatingPoint,
}

impl Predictor {
    /// The predictor of a number of the tag `Predictor`, if it goes with the samples.
    pub(super) fn new(code: u64, sample: Sample) -> TiffResult<Self> {
        match (code, sample) {
            (1, _) => Ok(Self::None),
            (2, Sample::Packed(_)) => damaged("the predictor of packed samples", 2, "1"),
            (2, _) => Ok(Self::Differences),
            (3, _) if sample.is_float() => Ok(Self::FloatingPoint),
            (3, _) => damaged(format!("the predictor of {} samples", sample.name()), 3, "1 or 2"),
            _ => unsupported(format!("predictor {code}, which is not known"), Remedy::Recompress),
        }
    }

    /// Turns a row as stored, of `interleaved` bands, into little-endian samples.
    pub(super) fn undo(self, row: &mut [u8], sample: Sample, interleaved: usize, big_endian: bool) {
        let size = sample.bits() / 8;
        // Bytes of floating-point samples are sorted by significance, whatever the order of the file.
        if self == Self::FloatingPoint {
            return undo_float_predictor(row, size, interleaved);
        }
        let whole = !matches!(sample, Sample::Packed(_));
        if big_endian && whole && size > 1 {
            row.chunks_exact_mut(size).for_each(<[u8]>::reverse);
        }
        if self == Self::Differences {
            match size {
                1 => undo_differences(row, interleaved, |[a], [b]: [u8; 1]| [a.wrapping_add(b)]),
                2 => undo_differences(row, interleaved, |a, b| {
                    u16::from_le_bytes(a).wrapping_add(u16::from_le_bytes(b)).to_le_bytes()
                }),
                4 => undo_differences(row, interleaved, |a, b| {
                    u32::from_le_bytes(a).wrapping_add(u32::from_le_bytes(b)).to_le_bytes()
                }),
                _ => undo_differences(row, interleaved, |a, b| {
                    u64::from_le_bytes(a).wrapping_add(u64::from_le_bytes(b)).to_le_bytes()
                }),
            }
        }
    }
}

/// Predictor 2 (TIFF 6.0, section 14): each sample is stored less its left neighbour of the same band.
fn undo_differences<const N: usize>(
    row: &mut [u8],
    interleaved: usize,
    add: impl Fn([u8; N], [u8; N]) -> [u8; N],
) {
    let (samples, _) = row.as_chunks_mut::<N>();
    for band in 0..interleaved {
        let mut sum = [0; N];
        for sample in samples.iter_mut().skip(band).step_by(interleaved) {
            sum = add(*sample, sum);
            *sample = sum;
        }
    }
}

/// Predictor 3 (TIFF Technical Note 3): the row is split into planes of bytes, most significant first, and
/// each byte is stored less the one `interleaved` before it.
fn undo_float_predictor(row: &mut [u8], size: usize, interleaved: usize) {
    undo_differences(row, interleaved, |[a], [b]: [u8; 1]| [a.wrapping_add(b)]);
    let planes = row.to_vec();
    match size {
        2 => join_planes::<2>(&planes, row),
        4 => join_planes::<4>(&planes, row),
        _ => join_planes::<8>(&planes, row),
    }
}

/// Little-endian samples of `N` bytes from planes of bytes, most significant first.
fn join_planes<const N: usize>(planes: &[u8], row: &mut [u8]) {
    let (samples, _) = row.as_chunks_mut::<N>();
    for (byte, plane) in planes.chunks_exact(samples.len().max(1)).take(N).enumerate() {
        samples.iter_mut().zip(plane).for_each(|(sample, value)| sample[N - 1 - byte] = *value);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn predictors_are_undone() {
        let mut row = [10, 20, 1, 2, 255, 255];
        undo_differences(&mut row, 2, |a: [u8; 1], b| [a[0].wrapping_add(b[0])]);
        assert_eq!(row, [10, 20, 11, 22, 10, 21]);

        let values = [1.5f32, -2.25];
        let mut row = [0; 8];
        for (i, v) in values.iter().enumerate() {
            for (byte, b) in v.to_be_bytes().into_iter().enumerate() {
                row[byte * 2 + i] = b;
            }
        }
        for i in (1..8).rev() {
            row[i] = row[i].wrapping_sub(row[i - 1]);
        }
        undo_float_predictor(&mut row, 4, 1);
        assert_eq!(row[..4], values[0].to_le_bytes());
        assert_eq!(row[4..], values[1].to_le_bytes());
    }
}
