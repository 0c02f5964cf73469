/// A grey texture with its mipmap.
///
/// Texel `(x, y)` covers `[x, x + 1) × [y, y + 1)`; a wrapping texture repeats and its sides are powers of two.
#[derive(Clone, Debug)]
pub(crate) struct Texture {
    levels: Vec<Level>,
    wrap: bool,
    texels_per_m: f32,
}

#[derive(Clone, Debug)]
struct Level {
    width: usize,
    height: usize,
    /// Of this level's size by the finest one's, per axis.
    scale: [f32; 2],
    texels: Vec<u8>,
}

/// Most samples along the stretched direction of a footprint.
const LARGEST_ANISOTROPY: usize = 8;
/// One over the number of samples.
const SHARES: [f32; LARGEST_ANISOTROPY + 1] =
    [0.0, 1.0, 1.0 / 2.0, 1.0 / 3.0, 1.0 / 4.0, 1.0 / 5.0, 1.0 / 6.0, 1.0 / 7.0, 1.0 / 8.0];
/// Places in a texture are held to this part of a texel.
const FRACTION_BITS: i32 = 10;
const FRACTION: f32 = (1 << FRACTION_BITS) as f32;
/// Levels of detail are this much finer than exact, for a crisp picture as lenses give it.
const LEVEL_BIAS: f32 = -0.2;

impl Texture {
    /// From the finest level, rows top to bottom.
    pub(crate) fn new(width: usize, height: usize, texels: Vec<u8>, wrap: bool, texels_per_m: f32) -> Self {
        debug_assert!(!wrap || (width.is_power_of_two() && height.is_power_of_two()));
        let mut levels = vec![Level { width, height, scale: [1.0; 2], texels }];
        while let Some(finer) = levels.last()
            && (finer.width > 1 || finer.height > 1)
        {
            let coarser = finer.halved([width, height]);
            levels.push(coarser);
        }
        Self { levels, wrap, texels_per_m }
    }

    /// Finest texels per metre.
    pub(crate) fn texels_per_m(&self) -> f32 {
        self.texels_per_m
    }

    /// The mean over a footprint: its centre and its two sides, in texels of the finest level.
    ///
    /// Trilinear samples are spread along the longer side, so that slanted surfaces stay sharp without shimmer.
    pub(crate) fn sample(&self, centre: [f32; 2], side_x: [f32; 2], side_y: [f32; 2]) -> f32 {
        let square = |side: [f32; 2]| side[0] * side[0] + side[1] * side[1];
        let (mut long, mut long2, mut short2) = (side_x, square(side_x), square(side_y));
        if short2 > long2 {
            (long, long2, short2) = (side_y, short2, long2);
        }
        // One sample more for every whole time that the longer side exceeds the shorter one.
        let count = 1 + (1..LARGEST_ANISOTROPY).filter(|k| long2 > (k * k) as f32 * short2).count();
        let share = SHARES[count];
        let width2 = (long2 * share * share).max(short2.min(long2));
        let level = (0.5 * fast_log2(width2.max(1e-6)) + LEVEL_BIAS).max(0.0);
        let last = self.levels.len() - 1;
        let fine = (level as usize).min(last);
        let blend = level - fine as f32;
        let near = self.along(&self.levels[fine], centre, long, count);
        if blend < 0.02 || fine == last {
            return near;
        }
        // Half as many samples of the coarser level cover the footprint as well.
        let far = self.along(&self.levels[fine + 1], centre, long, count.div_ceil(2));
        near + (far - near) * blend
    }

    /// As [`Texture::sample`] with one sample as wide as the footprint is long: for textures without detail.
    pub(crate) fn sample_roughly(&self, centre: [f32; 2], side_x: [f32; 2], side_y: [f32; 2]) -> f32 {
        let square = |side: [f32; 2]| side[0] * side[0] + side[1] * side[1];
        let width2 = square(side_x).max(square(side_y));
        let level = (0.5 * fast_log2(width2.max(1.0)) + 0.5) as usize;
        self.along(&self.levels[level.min(self.levels.len() - 1)], centre, [0.0; 2], 1)
    }

    /// The mean of `count` bilinear samples spread along a side of the footprint, in fixed point.
    fn along(&self, level: &Level, centre: [f32; 2], side: [f32; 2], count: usize) -> f32 {
        let share = SHARES[count];
        let first = 0.5 * share - 0.5;
        let start = |axis: usize| ((centre[axis] + side[axis] * first) * level.scale[axis] - 0.5) * FRACTION;
        let step = |axis: usize| (side[axis] * share * level.scale[axis] * FRACTION) as i32;
        let (mut u, mut v) = (start(0) as i32, start(1) as i32);
        let (step_u, step_v) = (step(0), step(1));
        let mut sum = 0_u32;
        for _ in 0..count {
            sum += if self.wrap { level.bilinear::<true>(u, v) } else { level.bilinear::<false>(u, v) };
            u += step_u;
            v += step_v;
        }
        sum as f32 * share * (1.0 / (FRACTION * FRACTION))
    }
}

impl Level {
    /// The value between four texels times `FRACTION²`, at a place in fixed point.
    fn bilinear<const WRAP: bool>(&self, u: i32, v: i32) -> u32 {
        const MASK: i32 = (1 << FRACTION_BITS) - 1;
        let index = |at: i32, size: usize| {
            if WRAP { at as usize & (size - 1) } else { at.clamp(0, size as i32 - 1) as usize }
        };
        let (left, top) = (u >> FRACTION_BITS, v >> FRACTION_BITS);
        let (fx, fy) = ((u & MASK) as u32, (v & MASK) as u32);
        let (x0, x1) = (index(left, self.width), index(left + 1, self.width));
        let upper = &self.texels[index(top, self.height) * self.width..][..self.width];
        let lower = &self.texels[index(top + 1, self.height) * self.width..][..self.width];
        let whole = 1 << FRACTION_BITS;
        let mix = |row: &[u8]| u32::from(row[x0]) * (whole - fx) + u32::from(row[x1]) * fx;
        mix(upper) * (whole - fy) + mix(lower) * fy
    }

    /// The next coarser level by a 2 × 2 box.
    fn halved(&self, finest: [usize; 2]) -> Self {
        let (width, height) = (self.width.div_ceil(2), self.height.div_ceil(2));
        let mut texels = Vec::with_capacity(width * height);
        for y in 0..height {
            for x in 0..width {
                let at = |dx: usize, dy: usize| {
                    let column = (2 * x + dx).min(self.width - 1);
                    let row = (2 * y + dy).min(self.height - 1);
                    u32::from(self.texels[row * self.width + column])
                };
                texels.push(((at(0, 0) + at(1, 0) + at(0, 1) + at(1, 1) + 2) / 4) as u8);
            }
        }
        let scale = [width as f32 / finest[0] as f32, height as f32 / finest[1] as f32];
        Self { width, height, scale, texels }
    }
}

/// The binary logarithm of a positive number to about 0.01, the same on every machine.
fn fast_log2(value: f32) -> f32 {
    let bits = value.to_bits();
    let exponent = ((bits >> 23) as i32 - 127) as f32;
    let mantissa = f32::from_bits((bits & 0x007F_FFFF) | 0x3F80_0000);
    exponent + (mantissa - 1.0) * (1.3465 - 0.3465 * mantissa)
}
