//! Pictures as PNG files.

use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder, RgbaImage};

use crate::error::{Error, Result};

/// An opaque picture as a PNG file: 8 bits per channel, without alpha.
///
/// # Errors
/// [`Error::Argument`] if PNG cannot hold it.
pub fn encode_png(picture: &RgbaImage) -> Result<Vec<u8>> {
    let rgb: Vec<u8> = picture.pixels().flat_map(|pixel| [pixel[0], pixel[1], pixel[2]]).collect();
    let mut out = Vec::new();
    PngEncoder::new_with_quality(&mut out, CompressionType::Fast, FilterType::Adaptive)
        .write_image(&rgb, picture.width(), picture.height(), ExtendedColorType::Rgb8)
        .map_err(|e| {
            let found = format!("not to be encoded ({e})");
            Error::argument("the picture", found, "one that PNG can hold")
        })?;
    Ok(out)
}
