//! Sums of products over a window at its position and at the neighbours to the right, below and diagonally.

use super::filters::WINDOW;

/// Elements from one row to the next, of the weights and of the region of the second image: with one stride for both, a sum
/// over the window is a single loop.
pub(super) const STRIDE: usize = 32;
pub(super) type Weights = [i16; STRIDE * WINDOW];

/// Pixels from the first one of a window to the last one of its neighbours.
pub(super) type Pixels = [i16; STRIDE * WINDOW_ROWS + STRIDE + 1];
const WINDOW_ROWS: usize = size_of::<Weights>() / size_of::<i16>() / STRIDE;

/// Offsets of the first pixels of the four positions from the first pixel of the window.
const OFFSETS: [usize; 4] = [0, 1, STRIDE, STRIDE + 1];

/// Sums of the products of both weights with the pixels at each of the four positions: `[[x, y]; 4]`, row by row.
pub(super) fn sums_of_products(weights: [&Weights; 2], pixels: &Pixels) -> [[i32; 2]; 4] {
    #[cfg(target_arch = "x86_64")]
    if let Some(simd) = pulp::x86::V3::try_new() {
        return simd.vectorize(PairedProducts { simd, weights, pixels });
    }
    OFFSETS.map(|offset| weights.map(|weights| dot(weights, &pixels[offset..])))
}

/// Sum of products.
///
/// A separate function over eight partial sums, which the compiler vectorizes.
#[inline(never)]
pub(super) fn dot(weights: &Weights, pixels: &[i16]) -> i32 {
    let mut sums = [0_i32; 8];
    for (weights, pixels) in weights.as_chunks::<8>().0.iter().zip(pixels.as_chunks::<8>().0) {
        for lane in 0..8 {
            sums[lane] += i32::from(weights[lane]) * i32::from(pixels[lane]);
        }
    }
    sums.iter().sum()
}

/// [`sums_of_products`] with AVX2, which multiplies 16 pairs and adds up neighbours in one instruction; compilers do
/// not generate it for registers of this width.
#[cfg(target_arch = "x86_64")]
struct PairedProducts<'a> {
    simd: pulp::x86::V3,
    weights: [&'a Weights; 2],
    pixels: &'a Pixels,
}

#[cfg(target_arch = "x86_64")]
impl pulp::NullaryFnOnce for PairedProducts<'_> {
    type Output = [[i32; 2]; 4];

    #[inline(always)]
    fn call(self) -> Self::Output {
        const LANES: usize = 16;
        let Self { simd, weights: [x, y], pixels } = self;
        let (x, y) = (x.as_chunks::<LANES>().0, y.as_chunks::<LANES>().0);
        let mut sums = [[simd.avx._mm256_setzero_si256(); 2]; 4];
        for (first, (x, y)) in (0..).step_by(LANES).zip(x.iter().zip(y)) {
            let weights = [x, y].map(|weights| pulp::cast::<[i16; LANES], core::arch::x86_64::__m256i>(*weights));
            for (sums, offset) in sums.iter_mut().zip(OFFSETS) {
                let Some(pixels) = pixels[first + offset..].first_chunk::<LANES>() else { continue };
                let pixels = pulp::cast(*pixels);
                for (sum, weights) in sums.iter_mut().zip(weights) {
                    *sum = simd.avx2._mm256_add_epi32(*sum, simd.avx2._mm256_madd_epi16(weights, pixels));
                }
            }
        }
        sums.map(|sums| sums.map(|sum| pulp::cast::<_, [i32; 8]>(sum).iter().sum()))
    }
}
