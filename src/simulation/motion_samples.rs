//! Prescribed motions of vehicle and joints as samples over time.

use nalgebra::Vector3;

/// Vehicle and joints at one time of a prescribed motion.
#[derive(Clone, Debug, PartialEq)]
pub struct MotionSample {
    pub time_s: f64,
    /// One angle per joint.
    pub joints_rad: Vec<f64>,
    /// Position of the IMU: forward, left and up at heading zero.
    pub position_m: Vector3<f64>,
    /// Rotation about the vertical, positive to the left.
    pub heading_rad: f64,
}

/// Samples of a motion in time order, as a file holds them.
#[derive(Clone, Debug, PartialEq)]
pub struct PrescribedMotion {
    pub joint_names: Vec<String>,
    pub samples: Vec<MotionSample>,
}

/// Longest motion that is accepted, in seconds.
const MAX_DURATION_S: f64 = 3600.0;
/// Longest time between two samples, in seconds.
const MAX_GAP_S: f64 = 2.0;
/// Largest distance from the start, in metres, and largest angle, in radians.
const MAX_VALUE: f64 = 1000.0;

impl PrescribedMotion {
    /// Time from the first sample to the last.
    pub fn duration_s(&self) -> f64 {
        match (self.samples.first(), self.samples.last()) {
            (Some(first), Some(last)) => last.time_s - first.time_s,
            _ => 0.0,
        }
    }

    /// Checks times and values.
    ///
    /// # Errors
    /// The first problem as a sentence, with its time.
    pub fn check(&self) -> Result<(), String> {
        let duration_s = self.duration_s();
        if !(0.5..=MAX_DURATION_S).contains(&duration_s) {
            return Err(format!("the motion lasts {duration_s:.3} s: expected 0.5 to {MAX_DURATION_S} s"));
        }
        for pair in self.samples.windows(2) {
            let (from_s, to_s) = (pair[0].time_s, pair[1].time_s);
            if to_s <= from_s || to_s - from_s > MAX_GAP_S {
                return Err(format!(
                    "the time after {from_s:.3} s is {to_s:.3} s: expected a later one, at most {MAX_GAP_S} s later"
                ));
            }
        }
        for sample in &self.samples {
            if sample.joints_rad.len() != self.joint_names.len() {
                return Err(format!("the sample at {:.3} s has another number of joints", sample.time_s));
            }
            let values = sample.joints_rad.iter().chain(sample.position_m.iter()).chain([&sample.heading_rad]);
            if let Some(value) = values.copied().find(|value| value.is_nan() || value.abs() > MAX_VALUE) {
                return Err(format!(
                    "a value at {:.3} s is {value}: expected −{MAX_VALUE} to {MAX_VALUE}",
                    sample.time_s
                ));
            }
        }
        Ok(())
    }

    /// The same motion with its joints in the order of these names.
    ///
    /// # Errors
    /// If its joints are others, as a sentence.
    pub fn with_joints(&self, names: &[String]) -> Result<Self, String> {
        let place = |name: &String| self.joint_names.iter().position(|known| known == name);
        let places: Option<Vec<usize>> = names.iter().map(place).collect();
        let Some(places) = places.filter(|places| places.len() == self.joint_names.len()) else {
            let list = |names: &[String]| if names.is_empty() { "none".to_owned() } else { names.join(", ") };
            return Err(format!("it has the joints {}, the rig has {}", list(&self.joint_names), list(names)));
        };
        let sample = |sample: &MotionSample| MotionSample {
            joints_rad: places.iter().map(|place| sample.joints_rad[*place]).collect(),
            ..sample.clone()
        };
        Ok(Self { joint_names: names.to_vec(), samples: self.samples.iter().map(sample).collect() })
    }

    /// Value of a channel at a time since the first sample, by linear interpolation.
    pub(super) fn value(&self, channel: usize, since_s: f64) -> f64 {
        let time_s = self.samples[0].time_s + since_s;
        let after = self.samples.partition_point(|sample| sample.time_s < time_s).clamp(1, self.samples.len() - 1);
        let (from, to) = (&self.samples[after - 1], &self.samples[after]);
        let ratio = ((time_s - from.time_s) / (to.time_s - from.time_s)).clamp(0.0, 1.0);
        let (first, second) = (from.channel(channel), to.channel(channel));
        first + (second - first) * ratio
    }
}

impl MotionSample {
    fn channel(&self, channel: usize) -> f64 {
        let joints = self.joints_rad.len();
        match channel.checked_sub(joints) {
            None => self.joints_rad[channel],
            Some(axis @ 0..3) => self.position_m[axis],
            Some(_) => self.heading_rad,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn motion(joints: &[&str]) -> PrescribedMotion {
        let sample = |step: i32| {
            let time_s = 0.1 * f64::from(step);
            MotionSample {
                time_s,
                joints_rad: (0..joints.len()).map(|joint| time_s * (joint + 1) as f64).collect(),
                position_m: Vector3::new(time_s, -time_s, 0.1),
                heading_rad: 0.5 * time_s,
            }
        };
        let joint_names = joints.iter().map(|name| (*name).to_owned()).collect();
        PrescribedMotion { joint_names, samples: (0..=40).map(sample).collect() }
    }

    #[test]
    fn motions_that_cannot_be_flown_are_rejected_with_their_place() {
        let motion = motion(&["pan"]);
        let check = |change: fn(&mut PrescribedMotion), words: &str| {
            let mut changed = motion.clone();
            change(&mut changed);
            let problem = changed.check().unwrap_err();
            assert!(problem.contains(words), "{problem}");
        };
        check(|motion| motion.samples.truncate(2), "lasts 0.100 s");
        check(|motion| motion.samples[7].time_s = 0.2, "after 0.600 s is 0.200 s");
        check(|motion| motion.samples[3].heading_rad = f64::NAN, "at 0.300 s is NaN");
        check(|motion| motion.samples[3].position_m.y = 1e9, "at 0.300 s");
        check(|motion| motion.samples[5].joints_rad.clear(), "number of joints");
        check(|motion| motion.samples.clear(), "lasts 0.000 s");
    }

    #[test]
    fn joints_are_found_by_their_names() {
        let names = |names: &[&str]| -> Vec<String> { names.iter().map(|name| (*name).to_owned()).collect() };
        let given = motion(&["pan", "tilt"]);
        let turned = given.with_joints(&names(&["tilt", "pan"])).unwrap();
        assert_eq!(turned.samples[10].joints_rad, [2.0, 1.0]);
        assert_eq!(turned.with_joints(&given.joint_names).unwrap(), given);
        for wrong in [&["pan"][..], &["pan", "roll"], &["pan", "tilt", "roll"], &[]] {
            let problem = given.with_joints(&names(wrong)).unwrap_err();
            assert!(problem.contains("it has the joints pan, tilt, the rig has"), "{problem}");
        }
    }
}
