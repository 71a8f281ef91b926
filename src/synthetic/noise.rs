//! Seeded random numbers and gradient noise, the same on every platform.

use super::scalar::Scalar;

/// A well mixed 64-bit number for the `index`-th draw of stream `seed`.
///
/// The output function of SplitMix64 (Steele, Lea, Flood, "Fast splittable pseudorandom number
/// generators", OOPSLA 2014) at state `seed + index · golden ratio`.
pub(super) fn hash(seed: u64, index: u64) -> u64 {
    let mut z = seed.wrapping_add(index.wrapping_mul(0x9e37_79b9_7f4a_7c15));
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// Two numbers in `[0, 1)` from one draw.
pub(super) fn uniform_pair(draw: u64) -> [f64; 2] {
    const SCALE: f64 = 1.0 / (1u64 << 32) as f64;
    [(draw >> 32) as f64 * SCALE, (draw & 0xffff_ffff) as f64 * SCALE]
}

/// Gradient noise of wavelength about 2: zero at the whole-numbered points, within ±1, twice
/// continuously differentiable.
///
/// Perlin, "Improving noise", SIGGRAPH 2002, with gradients drawn from a square instead of a table.
pub(super) fn gradient_noise<T: Scalar>(seed: u64, x: T, y: T) -> T {
    let (i, j) = (x.value().floor(), y.value().floor());
    let (u, v) = (x - i, y - j);
    let ramp = |di: f64, dj: f64| {
        let [gx, gy] = gradient_at(seed, i + di, j + dj);
        (u - di) * gx + (v - dj) * gy
    };
    let (su, sv) = (fade(u), fade(v));
    let south = mix(ramp(0.0, 0.0), ramp(1.0, 0.0), su);
    let north = mix(ramp(0.0, 1.0), ramp(1.0, 1.0), su);
    mix(south, north, sv)
}

/// The gradient of the noise at a whole-numbered point, from a square.
fn gradient_at(seed: u64, x: f64, y: f64) -> [f64; 2] {
    let draw = hash(hash(seed, x as i64 as u64), y as i64 as u64);
    uniform_pair(draw).map(|g| 2.0 * g - 1.0)
}

/// `6t⁵ − 15t⁴ + 10t³`, from 0 to 1 with zero first and second derivatives at both ends.
fn fade<T: Scalar>(t: T) -> T {
    t * t * t * (t * (t * 6.0 - 15.0) + 10.0)
}

fn mix<T: Scalar>(a: T, b: T, t: T) -> T {
    a + (b - a) * t
}

/// Mountains: octaves of noise folded into ridges, each octave rough only where the last one was high,
/// so that crests are sharp and valley floors smooth. Between 0 and 2.
///
/// Musgrave's ridged multifractal (Ebert et al., *Texturing and Modeling*, ch. 16) with the fold
/// `1 − |n|` replaced by the smooth `exp(−k(√(n² + ε²) − ε))`.
pub(super) fn ridged<T: Scalar>(seed: u64, octaves: u32, mut x: T, mut y: T) -> T {
    /// Width of the rounded crest, in units of the noise, and how steeply it falls off.
    const ROUNDING: f64 = 0.04;
    const STEEPNESS: f64 = 3.0;
    let mut sum = x * 0.0;
    let mut weight = sum + 1.0;
    for octave in 0..octaves {
        let n = gradient_noise(hash(seed, u64::from(octave)), x, y);
        let distance = (n * n + ROUNDING * ROUNDING).sqrt() - ROUNDING;
        weight = weight * (distance * -STEEPNESS).exp() * if octave == 0 { 1.0 } else { 0.5 };
        sum = sum + weight;
        // Half the wavelength; rotated (3-4-5 triangle) and shifted to hide the lattice.
        (x, y) = (x * 1.6 - y * 1.2 + 0.37, x * 1.2 + y * 1.6 + 0.71);
    }
    sum
}
