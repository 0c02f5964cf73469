/// Length of a vector in the plane, for inner loops over pixels.
#[expect(clippy::imprecise_flops, reason = "`hypot` is a call into the C library, this a vector instruction")]
#[expect(clippy::inline_always, reason = "code that is not inlined is not compiled for the registers of its caller")]
#[inline(always)]
pub(crate) fn planar_length([x, y]: [f32; 2]) -> f32 {
    (x * x + y * y).sqrt()
}
