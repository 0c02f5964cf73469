use nalgebra::{UnitQuaternion, Vector3};

use crate::geometry::so3;

/// Angular rate of a body over time, in its frame; linear between samples.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct AngularRates {
    times_s: Vec<f64>,
    rates_rad_per_s: Vec<Vector3<f64>>,
    /// Integral of the rates since the first sample, in radians.
    angles_rad: Vec<Vector3<f64>>,
    /// `first_from_now` since the first sample.
    rotations: Vec<UnitQuaternion<f64>>,
    bridges_gaps: bool,
}

/// Samples farther apart are not interpolated, in seconds.
const MAX_GAP_S: f64 = 0.15;

impl AngularRates {
    /// Rates in rad/s at times in seconds; samples whose time does not increase, or that are not finite, are omitted.
    pub fn new(samples: impl IntoIterator<Item = (f64, Vector3<f64>)>) -> Self {
        let mut rates = Self::default();
        for (time_s, rate) in samples {
            if !time_s.is_finite() || !rate.iter().all(|value| value.is_finite()) {
                continue;
            }
            let (mut angle, mut rotation) = (Vector3::zeros(), UnitQuaternion::identity());
            if let Some(last) = rates.times_s.len().checked_sub(1) {
                let step_s = time_s - rates.times_s[last];
                if step_s <= 0.0 {
                    continue;
                }
                let before = rates.rates_rad_per_s[last];
                angle = rates.angles_rad[last] + (before + rate) * (0.5 * step_s);
                rotation = rates.rotations[last] * so3::exp(&so3::of_linear_rate(&before, &rate, step_s));
            }
            rates.times_s.push(time_s);
            rates.rates_rad_per_s.push(rate);
            rates.angles_rad.push(angle);
            rates.rotations.push(rotation);
        }
        rates
    }

    /// The same rates, also interpolated between samples more than 0.15 s apart.
    #[must_use]
    pub fn bridging_gaps(self) -> Self {
        Self { bridges_gaps: true, ..self }
    }

    /// The rates with each one changed.
    #[must_use]
    pub fn changed(&self, change: impl Fn(&Vector3<f64>) -> Vector3<f64>) -> Self {
        let samples = self.times_s.iter().zip(&self.rates_rad_per_s).map(|(time_s, rate)| (*time_s, change(rate)));
        Self { bridges_gaps: self.bridges_gaps, ..Self::new(samples) }
    }

    /// Mean rates over `half_s` to each side of each sample, to remove vibration.
    #[must_use]
    pub fn smoothed(&self, half_s: f64) -> Self {
        let mean =
            |time_s: &f64| Some((*time_s, self.angle_between(time_s - half_s, time_s + half_s)? / (2.0 * half_s)));
        Self { bridges_gaps: self.bridges_gaps, ..Self::new(self.times_s.iter().filter_map(mean)) }
    }

    /// First and last time in seconds; `None` without samples.
    pub fn range_s(&self) -> Option<(f64, f64)> {
        Some((*self.times_s.first()?, *self.times_s.last()?))
    }

    /// Index of the sample before a time, and the fraction of the interval to the next one.
    fn place(&self, time_s: f64) -> Option<(usize, f64)> {
        let last = self.times_s.len().saturating_sub(1).max(1);
        let mut after = self.times_s.partition_point(|sample_s| *sample_s <= time_s).clamp(1, last);
        // The last sample before a gap belongs to the interval that ends there.
        let starts_gap = self.times_s.get(after).is_some_and(|to_s| self.is_gap(self.times_s[after - 1], *to_s));
        if starts_gap && after > 1 && self.times_s[after - 1] == time_s {
            after -= 1;
        }
        let (from_s, to_s) = (*self.times_s.get(after - 1)?, *self.times_s.get(after)?);
        let fraction = (time_s - from_s) / (to_s - from_s);
        ((0.0..=1.0).contains(&fraction) && !self.is_gap(from_s, to_s)).then_some((after - 1, fraction))
    }

    fn is_gap(&self, from_s: f64, to_s: f64) -> bool {
        !self.bridges_gaps && to_s - from_s > MAX_GAP_S
    }

    /// Rate at a time in rad/s; `None` outside the samples and in a gap.
    pub fn at(&self, time_s: f64) -> Option<Vector3<f64>> {
        let (index, fraction) = self.place(time_s)?;
        Some(self.rates_rad_per_s[index].lerp(&self.rates_rad_per_s[index + 1], fraction))
    }

    /// Integral of the rate since the first sample, in radians; `None` outside the samples and in a gap.
    pub(crate) fn angle_at(&self, time_s: f64) -> Option<Vector3<f64>> {
        let (index, fraction) = self.place(time_s)?;
        let (rate, change) =
            (self.rates_rad_per_s[index], self.rates_rad_per_s[index + 1] - self.rates_rad_per_s[index]);
        let step_s = fraction * (self.times_s[index + 1] - self.times_s[index]);
        Some(self.angles_rad[index] + (rate + change * (0.5 * fraction)) * step_s)
    }

    /// True if no gap lies between two times within the samples, the first of which is the earlier one.
    fn is_gapless(&self, from_s: f64, to_s: f64) -> bool {
        let (Some((from, _)), Some((to, _))) = (self.place(from_s), self.place(to_s)) else { return false };
        let between = self.times_s.get(from..=to);
        between.is_some_and(|times_s| !times_s.windows(2).any(|pair| self.is_gap(pair[0], pair[1])))
    }

    /// Integral of the rate between two times: a rotation vector in radians if the axis is constant. `None` outside the
    /// samples, or over a gap between them.
    pub fn angle_between(&self, from_s: f64, to_s: f64) -> Option<Vector3<f64>> {
        self.is_gapless(from_s, to_s).then_some(self.angle_at(to_s)? - self.angle_at(from_s)?)
    }

    /// Orientation `first_from_now` since the first sample; `None` outside the samples and in a gap.
    pub fn orientation_at(&self, time_s: f64) -> Option<UnitQuaternion<f64>> {
        let (index, fraction) = self.place(time_s)?;
        let (before, after) = (self.rates_rad_per_s[index], self.rates_rad_per_s[index + 1]);
        let step_s = fraction * (self.times_s[index + 1] - self.times_s[index]);
        Some(self.rotations[index] * so3::exp(&so3::of_linear_rate(&before, &before.lerp(&after, fraction), step_s)))
    }

    /// Rotation `second_from_first` of the body between two times. `None` outside the samples, or over a gap between
    /// them.
    pub fn rotation_between(&self, from_s: f64, to_s: f64) -> Option<UnitQuaternion<f64>> {
        let rotation = self.orientation_at(to_s)?.inverse() * self.orientation_at(from_s)?;
        self.is_gapless(from_s, to_s).then_some(rotation)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rate(time_s: f64) -> Vector3<f64> {
        Vector3::new(1.0 - time_s, 2.0 * time_s, 0.5 + 3.0 * time_s)
    }

    #[test]
    fn rotations_and_angles_are_integrals_of_the_rates() {
        let rates = AngularRates::new((0..=50).map(|step| 0.02 * f64::from(step)).map(|time_s| (time_s, rate(time_s))));
        for (from_s, to_s) in [(0.0, 1.0), (0.13, 0.131), (0.21, 0.987), (0.5, 0.5)] {
            let steps = 20_000;
            let step_s = (to_s - from_s) / f64::from(steps);
            let (mut angle, mut first_from_now) = (Vector3::zeros(), UnitQuaternion::identity());
            for step in 0..steps {
                let change = rate(from_s + step_s * (f64::from(step) + 0.5)) * step_s;
                angle += change;
                first_from_now *= so3::exp(&change);
            }
            assert!((rates.angle_between(from_s, to_s).unwrap() - angle).norm() < 1e-12);
            let found = rates.rotation_between(from_s, to_s).unwrap();
            assert!(found.angle_to(&first_from_now.inverse()) < 1e-6, "{from_s} {to_s}");
        }
        assert!((rates.at(0.33).unwrap() - rate(0.33)).norm() < 1e-12);
    }

    #[test]
    fn rates_end_with_their_samples_and_at_gaps() {
        let rates = AngularRates::new([0.0, 0.1, 0.2, 0.2, 0.1, f64::NAN, 0.4, 0.5].map(|time_s| (time_s, rate(0.0))));
        assert!(rates.at(0.0).is_some() && rates.at(0.5).is_some() && rates.rotation_between(0.0, 0.2).is_some());
        assert!(rates.at(-0.01).is_none() && rates.at(0.51).is_none() && rates.at(0.3).is_none());
        assert!(rates.angle_between(0.0, 0.5).is_none() && rates.rotation_between(0.0, 0.5).is_none());
        let bridged = rates.bridging_gaps();
        assert!((bridged.angle_between(0.0, 0.5).unwrap() - 0.5 * rate(0.0)).norm() < 1e-12);
        assert!(bridged.rotation_between(0.0, 0.5).is_some() && AngularRates::default().range_s().is_none());
    }
}
