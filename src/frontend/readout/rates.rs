use nalgebra::Vector3;

/// Angular rate of a camera over time, in the camera frame; linear between samples.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct AngularRates {
    times_s: Vec<f64>,
    rates_rad_per_s: Vec<Vector3<f64>>,
    /// Integral of the rates since the first sample, in radians.
    angles_rad: Vec<Vector3<f64>>,
}

/// Samples farther apart are not interpolated, in seconds.
const MAX_GAP_S: f64 = 0.15;
/// Number of rows for which a sweep is computed.
const NODES: usize = 9;

/// Rotation of a camera during the readout of an image: rotation vectors by row, relative to the first row.
pub(super) struct Sweep([Vector3<f64>; NODES]);

impl AngularRates {
    /// Rates in rad/s in the camera frame at times in seconds; samples whose time does not increase, or that are not
    /// finite, are omitted.
    pub fn new(samples: impl IntoIterator<Item = (f64, Vector3<f64>)>) -> Self {
        let mut rates = Self::default();
        for (time_s, rate) in samples {
            if !time_s.is_finite() || !rate.iter().all(|value| value.is_finite()) {
                continue;
            }
            let angle = match (rates.times_s.last(), rates.rates_rad_per_s.last(), rates.angles_rad.last()) {
                (Some(last_s), ..) if *last_s >= time_s => continue,
                (Some(last_s), Some(last), Some(angle)) => angle + (last + rate) * (0.5 * (time_s - last_s)),
                _ => Vector3::zeros(),
            };
            rates.times_s.push(time_s);
            rates.rates_rad_per_s.push(rate);
            rates.angles_rad.push(angle);
        }
        rates
    }

    /// Mean rates over `half_s` to each side of each sample, to remove vibration, which averages out over the readout.
    #[must_use]
    pub(super) fn smoothed(&self, half_s: f64) -> Self {
        let mean =
            |time_s: &f64| Some((*time_s, self.angle_between(time_s - half_s, time_s + half_s)? / (2.0 * half_s)));
        Self::new(self.times_s.iter().filter_map(mean))
    }

    /// Index of the sample before a time, and the fraction of the interval to the next one.
    fn place(&self, time_s: f64) -> Option<(usize, f64)> {
        let after = self.times_s.partition_point(|sample_s| *sample_s <= time_s).clamp(1, self.times_s.len().max(1));
        let (from_s, to_s) = (*self.times_s.get(after - 1)?, *self.times_s.get(after)?);
        let fraction = (time_s - from_s) / (to_s - from_s);
        ((0.0..=1.0).contains(&fraction) && to_s - from_s <= MAX_GAP_S).then_some((after - 1, fraction))
    }

    /// Rate at a time in rad/s; `None` outside the samples.
    pub fn at(&self, time_s: f64) -> Option<Vector3<f64>> {
        let (index, fraction) = self.place(time_s)?;
        Some(self.rates_rad_per_s[index].lerp(&self.rates_rad_per_s[index + 1], fraction))
    }

    /// Integral of the rate since the first sample, in radians.
    fn angle_at(&self, time_s: f64) -> Option<Vector3<f64>> {
        let (index, fraction) = self.place(time_s)?;
        let (rate, change) =
            (self.rates_rad_per_s[index], self.rates_rad_per_s[index + 1] - self.rates_rad_per_s[index]);
        let step_s = fraction * (self.times_s[index + 1] - self.times_s[index]);
        Some(self.angles_rad[index] + (rate + change * (0.5 * fraction)) * step_s)
    }

    /// Integral of the rate between two times: a rotation vector in radians if the axis is constant. `None` outside the
    /// samples, or over a gap between them.
    pub fn angle_between(&self, from_s: f64, to_s: f64) -> Option<Vector3<f64>> {
        let (from, to) = (self.place(from_s)?, self.place(to_s)?);
        let gap = self.times_s[from.0..=to.0].windows(2).any(|pair| pair[1] - pair[0] > MAX_GAP_S);
        (!gap).then_some(self.angle_at(to_s)? - self.angle_at(from_s)?)
    }

    /// Rotation during the readout of an image whose first row is exposed at a time; zero without rates.
    pub(super) fn sweep(&self, first_row_s: f64, readout_s: f64) -> Sweep {
        let start = self.angle_at(first_row_s);
        Sweep(std::array::from_fn(|node| {
            let row_s = readout_s * node as f64 / (NODES - 1) as f64;
            match (start, self.angle_at(first_row_s + row_s)) {
                (Some(start), Some(end)) => end - start,
                _ => Vector3::zeros(),
            }
        }))
    }
}

impl Sweep {
    /// Rotation vector (rad) at a row, as a ratio of the height: it maps directions in the camera at that row to the
    /// camera at the first row.
    pub(super) fn at(&self, row: f64) -> Vector3<f64> {
        let place = (row * (NODES - 1) as f64).clamp(0.0, (NODES - 1) as f64);
        let before = (place as usize).min(NODES - 2);
        self.0[before].lerp(&self.0[before + 1], place - before as f64)
    }
}
