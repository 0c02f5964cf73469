use crate::geometry::SplitMix64;

/// Stream of random numbers that depends on a seed, a stream number and a counter only.
///
/// The generator is PCG-RXS-M-XS 64 (O'Neill 2014) over a 64-bit linear congruential state; streams differ by their
/// increment, so that a new sensor does not change the noise of the others.
#[derive(Clone, Debug)]
pub struct RandomStream {
    state: u64,
    increment: u64,
    spare_normal: Option<f64>,
}

/// One round of `splitmix64`, which mixes structured integers.
pub fn mix(value: u64) -> u64 {
    SplitMix64::new(value).next_u64()
}

impl RandomStream {
    pub fn new(seed: u64, stream: u64) -> Self {
        let key = mix(mix(seed) ^ stream.wrapping_mul(0xD6E8_FEB8_6659_FD93));
        Self { state: mix(key), increment: (mix(key ^ 0x5851_F42D) << 1) | 1, spare_normal: None }
    }

    pub fn next_u64(&mut self) -> u64 {
        self.state = self.state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(self.increment);
        let word = ((self.state >> ((self.state >> 59) + 5)) ^ self.state).wrapping_mul(12_605_985_483_714_917_081);
        (word >> 43) ^ word
    }

    /// Uniform in `[0, 1)`.
    pub fn unit(&mut self) -> f64 {
        (self.next_u64() >> 11) as f64 * (1.0 / (1_u64 << 53) as f64)
    }

    /// Uniform in `[low, high)`.
    pub fn uniform(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    /// Index below `count`; 0 if `count` is 0.
    pub fn index(&mut self, count: usize) -> usize {
        ((self.unit() * count as f64) as usize).min(count.saturating_sub(1))
    }

    /// True with this probability.
    pub fn chance(&mut self, probability: f64) -> bool {
        self.unit() < probability
    }

    /// Normal with mean 0 and standard deviation 1 (Box–Muller).
    pub fn normal(&mut self) -> f64 {
        if let Some(value) = self.spare_normal.take() {
            return value;
        }
        let radius = (-2.0 * (1.0 - self.unit()).ln()).sqrt();
        let angle = std::f64::consts::TAU * self.unit();
        self.spare_normal = Some(radius * angle.sin());
        radius * angle.cos()
    }

    /// Three independent normals of this standard deviation.
    pub(crate) fn normal_vector(&mut self, sigma: f64) -> nalgebra::Vector3<f64> {
        nalgebra::Vector3::new(self.normal(), self.normal(), self.normal()) * sigma
    }
}
