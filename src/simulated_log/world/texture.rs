/// Values of some pixels from a function of their number. `array::map` and `array::from_fn` are not inlined over codegen
/// units, which takes a quarter of the time of an image.
#[inline]
pub(crate) fn lanes<T: Copy + Default, const N: usize>(value: impl Fn(usize) -> T) -> [T; N] {
    let mut values = [T::default(); N];
    for (k, slot) in values.iter_mut().enumerate() {
        *slot = value(k);
    }
    values
}

/// Two components from a function of the axis.
#[inline]
pub(crate) fn axes<T>(value: impl Fn(usize) -> T) -> [T; 2] {
    [value(0), value(1)]
}

/// Grey texture with its mipmap.
///
/// Texel `(x, y)` covers `[x, x + 1) × [y, y + 1)`; a wrapping texture repeats and its sides are powers of two.
#[derive(Clone, Debug)]
pub(crate) struct WorldTexture {
    levels: Vec<Level>,
    wrap: bool,
    texels_per_m: f32,
}

#[derive(Clone, Debug)]
struct Level {
    width: usize,
    height: usize,
    /// Texels of this level per texel of the finest one, along a side.
    scale: f32,
    /// Rows with one more texel than the width, and one more row than the height: a copy of the opposite border for a
    /// wrapping texture, otherwise of the border itself.
    texels: Vec<u8>,
}

/// Footprints of some pixels in a texture: centres and two sides, in texels of the finest level.
#[derive(Clone, Copy)]
pub(crate) struct Footprints<const N: usize> {
    pub(crate) centre: [[f32; N]; 2],
    pub(crate) sides: [[[f32; N]; 2]; 2],
}

impl<const N: usize> Footprints<N> {
    /// Converts from other units to texels.
    #[inline]
    pub(crate) fn scaled(&self, scale: f32) -> Self {
        let scaled = |values: &[[f32; N]; 2]| axes(|axis| lanes(|k| values[axis][k] * scale));
        Self { centre: scaled(&self.centre), sides: axes(|side| scaled(&self.sides[side])) }
    }

    /// Squared lengths of the two sides.
    #[inline]
    fn squares(&self) -> [[f32; N]; 2] {
        axes(|side| {
            let [x, y] = &self.sides[side];
            lanes(|k| x[k] * x[k] + y[k] * y[k])
        })
    }
}

/// Maximum number of samples along the longer side of a footprint.
const LARGEST_ANISOTROPY: usize = 8;
/// Inverse of the number of samples.
const RECIPROCALS: [f32; LARGEST_ANISOTROPY + 1] =
    [0.0, 1.0, 1.0 / 2.0, 1.0 / 3.0, 1.0 / 4.0, 1.0 / 5.0, 1.0 / 6.0, 1.0 / 7.0, 1.0 / 8.0];
/// Number of fractional bits of a position in texels.
const FRACTION_BITS: i32 = 10;
const FRACTION: f32 = (1 << FRACTION_BITS) as f32;
/// Offset of the level of detail: finer than exact, for images as sharp as the images of a lens.
const LEVEL_BIAS: f32 = -0.2;

impl WorldTexture {
    /// Texture from the finest level, rows top to bottom.
    pub(crate) fn new(width: usize, height: usize, texels: &[u8], wrap: bool, texels_per_m: f32) -> Self {
        debug_assert!(!wrap || (width.is_power_of_two() && height.is_power_of_two()));
        let mut levels = vec![Level::new([width, height], 1.0, texels, wrap)];
        while let Some(finer) = levels.last()
            && (finer.width > 1 || finer.height > 1)
        {
            let coarser = finer.halved(wrap);
            levels.push(coarser);
        }
        Self { levels, wrap, texels_per_m }
    }

    /// Texels per metre of the finest level.
    #[inline]
    pub(crate) fn texels_per_m(&self) -> f32 {
        self.texels_per_m
    }

    /// Means over the first `count` footprints.
    ///
    /// Trilinear samples are distributed along the longer side, so that slanted surfaces are sharp and free of
    /// aliasing.
    pub(crate) fn sample<const N: usize>(&self, footprints: &Footprints<N>, count: usize) -> [f32; N] {
        let [across, down] = footprints.squares();
        let turned: [bool; N] = lanes(|k| down[k] > across[k]);
        let pick = |turned: bool, no: f32, yes: f32| if turned { yes } else { no };
        let long: [[f32; N]; 2] =
            axes(|axis| lanes(|k| pick(turned[k], footprints.sides[0][axis][k], footprints.sides[1][axis][k])));
        let long2: [f32; N] = lanes(|k| pick(turned[k], across[k], down[k]));
        let short2: [f32; N] = lanes(|k| pick(turned[k], down[k], across[k]));
        // One additional sample for each multiple of the shorter side that the longer side exceeds.
        let mut counts = [1_i32; N];
        for times in 1..LARGEST_ANISOTROPY {
            let square = (times * times) as f32;
            for k in 0..N {
                counts[k] += i32::from(long2[k] > square * short2[k]);
            }
        }
        let levels: [f32; N] = lanes(|k| {
            let fraction = 1.0 / counts[k] as f32;
            let width2 = (long2[k] * fraction * fraction).max(short2[k].min(long2[k]));
            (0.5 * fast_log2(width2.max(1e-6)) + LEVEL_BIAS).max(0.0)
        });
        let mut means = [0.0; N];
        for k in 0..count.min(N) {
            let (centre, long) = (axes(|axis| footprints.centre[axis][k]), axes(|axis| long[axis][k]));
            means[k] = self.trilinear(levels[k], centre, long, counts[k] as usize);
        }
        means
    }

    /// Mean of `count` samples along a side of a footprint, interpolated between two levels of detail.
    #[inline]
    fn trilinear(&self, level: f32, centre: [f32; 2], side: [f32; 2], count: usize) -> f32 {
        let last = self.levels.len() - 1;
        let fine = (level as usize).min(last);
        let blend = level - fine as f32;
        let near = self.along(&self.levels[fine], centre, side, count);
        if blend < 0.02 || fine == last {
            return near;
        }
        // Half as many samples of the coarser level cover the footprint.
        let far = self.along(&self.levels[fine + 1], centre, side, count.div_ceil(2));
        near + (far - near) * blend
    }

    /// [`WorldTexture::sample`] with one sample as wide as the longer side, for textures without detail.
    pub(crate) fn sample_roughly<const N: usize>(&self, footprints: &Footprints<N>, count: usize) -> [f32; N] {
        let [across, down] = footprints.squares();
        let mut values = [0.0; N];
        for k in 0..count.min(N) {
            let width2 = across[k].max(down[k]);
            let level = (0.5 * fast_log2(width2.max(1.0)) + 0.5) as usize;
            let centre = axes(|axis| footprints.centre[axis][k]);
            values[k] = self.along(&self.levels[level.min(self.levels.len() - 1)], centre, [0.0; 2], 1);
        }
        values
    }

    /// Mean of `count` bilinear samples along a side of the footprint, in fixed point.
    #[inline]
    fn along(&self, level: &Level, centre: [f32; 2], side: [f32; 2], count: usize) -> f32 {
        let fraction = RECIPROCALS[count];
        let first = 0.5 * fraction - 0.5;
        let start = |axis: usize| ((centre[axis] + side[axis] * first) * level.scale - 0.5) * FRACTION;
        let step = |axis: usize| (side[axis] * fraction * level.scale * FRACTION) as i32;
        let (mut u, mut v) = (start(0) as i32, start(1) as i32);
        let (step_u, step_v) = (step(0), step(1));
        let mut sum = 0_u32;
        for _ in 0..count {
            sum += if self.wrap { level.bilinear::<true>(u, v) } else { level.bilinear::<false>(u, v) } as u32;
            u += step_u;
            v += step_v;
        }
        sum as f32 * fraction * (1.0 / (FRACTION * FRACTION))
    }
}

impl Level {
    fn new([width, height]: [usize; 2], scale: f32, texels: &[u8], wrap: bool) -> Self {
        let after = |size: usize| if wrap { 0 } else { size - 1 };
        let mut padded = Vec::with_capacity((width + 1) * (height + 1));
        for row in (0..height).chain([after(height)]) {
            let row = &texels[row * width..][..width];
            padded.extend_from_slice(row);
            padded.push(row[after(width)]);
        }
        Self { width, height, scale, texels: padded }
    }

    /// Interpolated value between four texels times `FRACTION²`, at a position in fixed point.
    #[inline]
    fn bilinear<const WRAP: bool>(&self, u: i32, v: i32) -> i32 {
        const MASK: i32 = (1 << FRACTION_BITS) - 1;
        let within = |at: i32, size: usize| if WRAP { at } else { at.clamp(0, (size as i32 - 1) << FRACTION_BITS) };
        let (u, v) = (within(u, self.width), within(v, self.height));
        let index = |at: i32, size: usize| (at >> FRACTION_BITS) as usize & if WRAP { size - 1 } else { usize::MAX };
        let stride = self.width + 1;
        let at = index(v, self.height) * stride + index(u, self.width);
        let (upper, lower) = (&self.texels[at..at + 2], &self.texels[at + stride..at + stride + 2]);
        let mix = |from: i32, to: i32, fraction: i32| (from << FRACTION_BITS) + (to - from) * fraction;
        let across = |row: &[u8]| mix(i32::from(row[0]), i32::from(row[1]), u & MASK);
        mix(across(upper), across(lower), v & MASK)
    }

    /// Next coarser level by a 2 × 2 box. If a side is odd, its last texel extends past the border: scaled to end at
    /// the border, the texture would move on its face with the distance of the camera.
    fn halved(&self, wrap: bool) -> Self {
        let (width, height) = (self.width.div_ceil(2), self.height.div_ceil(2));
        let mut texels = Vec::with_capacity(width * height);
        for y in 0..height {
            for x in 0..width {
                let at = |dx: usize, dy: usize| {
                    let column = (2 * x + dx).min(self.width - 1);
                    let row = (2 * y + dy).min(self.height - 1);
                    u32::from(self.texels[row * (self.width + 1) + column])
                };
                texels.push(((at(0, 0) + at(1, 0) + at(0, 1) + at(1, 1) + 2) / 4) as u8);
            }
        }
        Self::new([width, height], 0.5 * self.scale, &texels, wrap)
    }
}

/// Binary logarithm of a positive number to about 0.01, equal on all platforms.
#[inline]
fn fast_log2(value: f32) -> f32 {
    let bits = value.to_bits();
    let exponent = ((bits >> 23) as i32 - 127) as f32;
    let mantissa = f32::from_bits((bits & 0x007F_FFFF) | 0x3F80_0000);
    exponent + (mantissa - 1.0) * (1.3465 - 0.3465 * mantissa)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levels_of_sides_that_are_no_powers_of_two_lie_on_each_other() {
        // Half a grey value per texel: the grey value identifies the texel.
        for size in [509_u16, 385, 301] {
            let texels: Vec<u8> = (0..size).map(|x| (x / 2) as u8).collect();
            let texture = WorldTexture::new(texels.len(), 1, &texels, false, 1.0);
            for width in [1.0, 2.0, 4.0, 8.0, 16.0] {
                for centre in [48.0, 0.5 * f32::from(size), f32::from(size) - 48.0] {
                    let sides = [[[width], [0.0]], [[0.0], [width]]];
                    let [grey] = texture.sample(&Footprints { centre: [[centre], [0.5]], sides }, 1);
                    // Texels and the means of each level are rounded.
                    let expected = 0.5 * (centre - 1.0);
                    assert!((grey - expected).abs() < 0.75, "{size} {width} {centre}: {grey}, expected {expected}");
                }
            }
        }
    }
}
