//! Comparison of two runs on the same log by frame: differences and first divergence.

use std::collections::BTreeSet;

use nalgebra::UnitQuaternion;

use super::run::RunRecord;
use super::step::StepRecord;
use super::trajectory_lane::{TrajectoryLane, yaw_and_position};
use crate::estimator::{FrameStateReport, Phase};
use crate::geometry::{RigidTransform, so3, wrap_angle};
use crate::text::Named;

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum ComparedQuantity {
    Phase,
    Tracks,
    Keyframe,
    Position,
    Attitude,
    Velocity,
    AccelerometerBias,
    GyroscopeBias,
    JointAngles,
    ChainTranslation,
    ChainRotation,
    Reprojection,
    RankStructural,
    RankInformed,
}

/// In the order in which a difference usually spreads.
impl Named for ComparedQuantity {
    const NAMES: &'static [(Self, &'static str)] = &[
        (Self::Phase, "phase"),
        (Self::Tracks, "tracks"),
        (Self::Keyframe, "keyframes"),
        (Self::Position, "position"),
        (Self::Attitude, "attitude"),
        (Self::Velocity, "velocity"),
        (Self::AccelerometerBias, "accelerometer bias"),
        (Self::GyroscopeBias, "gyroscope bias"),
        (Self::JointAngles, "joint angles"),
        (Self::ChainTranslation, "extrinsics, translation"),
        (Self::ChainRotation, "extrinsics, rotation"),
        (Self::Reprojection, "reprojection RMS"),
        (Self::RankStructural, "structural rank"),
        (Self::RankInformed, "informed rank"),
    ];
}

impl ComparedQuantity {
    /// Unit as stored, empty for counts, and threshold of a notable difference: 1 cm and 0.1° for a trajectory, 1 mm and
    /// 0.1° for a calibration; for biases, the values that change the trajectory by the same amount within a second.
    const fn unit_and_threshold(self) -> (&'static str, f64) {
        match self {
            Self::Phase | Self::Tracks | Self::Keyframe | Self::RankStructural | Self::RankInformed => ("", 1.0),
            Self::Position => ("m", 0.01),
            Self::Attitude | Self::JointAngles | Self::ChainRotation => ("rad", 0.001_745),
            Self::Velocity => ("m/s", 0.01),
            Self::AccelerometerBias => ("m/s²", 0.01),
            Self::GyroscopeBias => ("rad/s", 0.000_1),
            Self::ChainTranslation => ("m", 0.001),
            Self::Reprojection => ("px", 0.05),
        }
    }

    /// Definition of the difference.
    pub const fn meaning(self) -> &'static str {
        match self {
            Self::Phase => "1 where one run is initializing and the other is tracking",
            Self::Tracks => "Number of features that only one of the runs tracks",
            Self::Keyframe => "1 where the frame is a keyframe in one run only",
            Self::Position => "Distance of the IMU positions, after alignment of the worlds in yaw and position",
            Self::Attitude => "Angle between the IMU attitudes, after alignment of the worlds in yaw",
            Self::Velocity => "Norm of the velocity difference, after alignment of the worlds in yaw",
            Self::AccelerometerBias => "Norm of the difference of the accelerometer biases",
            Self::GyroscopeBias => "Norm of the difference of the gyroscope biases",
            Self::JointAngles => "Largest difference of the estimated joint angles",
            Self::ChainTranslation => "Difference of imu_from_camera at the joint angles of the frame, translation",
            Self::ChainRotation => "Difference of imu_from_camera at the joint angles of the frame, rotation",
            Self::Reprojection => "Difference of the reprojection RMS after the solve",
            Self::RankStructural => "Difference of the structural ranks",
            Self::RankInformed => "Difference of the informed ranks",
        }
    }

    /// Unit as stored; empty for counts.
    pub const fn unit(self) -> &'static str {
        self.unit_and_threshold().0
    }

    /// Threshold of a notable difference, in its unit.
    pub const fn notable(self) -> f64 {
        self.unit_and_threshold().1
    }

    /// Difference of two steps with the same stamp. The world of `b` is transformed by `gauge` (`world_a_from_world_b`)
    /// first. Returns `None` where a step does not have the quantity.
    pub fn difference(self, a: &StepRecord, b: &StepRecord, gauge: &RigidTransform) -> Option<f64> {
        let frames = || Some((a.report.newest()?, b.report.newest()?));
        let flag = |differ: bool| Some(f64::from(u8::from(differ)));
        let count = |a: usize, b: usize| Some(a.abs_diff(b) as f64);
        let ranks = || Some((a.rank.as_ref()?, b.rank.as_ref()?));
        match self {
            Self::Phase => flag((a.report.phase == Phase::Tracking) != (b.report.phase == Phase::Tracking)),
            Self::Tracks => Some(track_difference(a, b)),
            Self::Keyframe => frames().and_then(|_| flag(a.report.keyframe != b.report.keyframe)),
            Self::Position => {
                let (a, b) = frames()?;
                Some((gauge.transform(&b.world_from_imu.translation_m) - a.world_from_imu.translation_m).norm())
            }
            Self::Attitude => {
                let (a, b) = frames()?;
                Some(angle(&a.world_from_imu.rotation, &(gauge.rotation * b.world_from_imu.rotation)))
            }
            Self::Velocity => {
                let (a, b) = frames()?;
                Some((gauge.rotation * b.velocity_m_per_s - a.velocity_m_per_s).norm())
            }
            Self::AccelerometerBias => {
                let (a, b) = frames()?;
                Some((b.accelerometer_bias_m_per_s2 - a.accelerometer_bias_m_per_s2).norm())
            }
            Self::GyroscopeBias => {
                let (a, b) = frames()?;
                Some((b.gyroscope_bias_rad_per_s - a.gyroscope_bias_rad_per_s).norm())
            }
            Self::JointAngles => frames().and_then(|(a, b)| joint_difference(a, b)),
            Self::ChainTranslation => {
                let (a, b) = frames()?;
                Some((b.imu_from_camera.translation_m - a.imu_from_camera.translation_m).norm())
            }
            Self::ChainRotation => {
                let (a, b) = frames()?;
                Some(angle(&a.imu_from_camera.rotation, &b.imu_from_camera.rotation))
            }
            Self::Reprojection => {
                frames()?;
                let [a, b] = [a, b].map(|step| step.report.reprojection_rms_after_px);
                Some((b - a).abs()).filter(|apart| apart.is_finite())
            }
            Self::RankStructural => ranks().and_then(|(a, b)| count(a.rank_structural, b.rank_structural)),
            Self::RankInformed => ranks().and_then(|(a, b)| count(a.rank_informed, b.rank_informed)),
        }
    }

    /// True if runs on different cameras can be compared in this quantity.
    const fn is_of_the_vehicle(self) -> bool {
        !matches!(
            self,
            Self::Tracks | Self::JointAngles | Self::ChainTranslation | Self::ChainRotation | Self::Reprojection
        )
    }
}

/// Angle between two attitudes in radians; exactly zero for equal ones.
fn angle(a: &UnitQuaternion<f64>, b: &UnitQuaternion<f64>) -> f64 {
    if a == b { 0.0 } else { so3::log(&(a.inverse() * b)).norm() }
}

fn joint_difference(a: &FrameStateReport, b: &FrameStateReport) -> Option<f64> {
    let (a, b) = (&a.joint_angles_rad, &b.joint_angles_rad);
    let apart = a.iter().zip(b).map(|(a, b)| wrap_angle(b - a).abs()).fold(0.0, f64::max);
    (!a.is_empty() && a.len() == b.len()).then_some(apart)
}

fn track_difference(a: &StepRecord, b: &StepRecord) -> f64 {
    if a.tracks.is_same(&b.tracks) {
        return 0.0;
    }
    let ids =
        |step: &StepRecord| step.tracks.frame().features.iter().map(|feature| feature.id).collect::<BTreeSet<_>>();
    ids(a).symmetric_difference(&ids(b)).count() as f64
}

/// First divergence of two runs in one quantity.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Divergence {
    /// Stamp of the first exact difference (values not equal), `None` without one.
    pub exact_ns: Option<i64>,
    /// Stamp of the first notable difference (at least [`ComparedQuantity::notable`]), `None` without one.
    pub notable_ns: Option<i64>,
    /// Largest difference and its stamp.
    pub largest: Option<(f64, i64)>,
}

/// Comparison of a run with a reference run, updated as both are computed.
///
/// At the first stamp at which both have a pose, the run's world is aligned with the reference's by yaw and position,
/// the gauge freedom of visual-inertial odometry. A fork uses its parent's world.
#[derive(Clone, Debug, Default)]
pub struct Comparison {
    runs: Option<(u64, u64)>,
    read: (usize, usize),
    gauge: Option<RigidTransform>,
    same_camera: bool,
    /// Stamps common to both runs, in nanoseconds since the log began.
    pub stamps_ns: Vec<i64>,
    /// Differences by quantity and row; NaN where a run does not have the quantity.
    pub columns: [Vec<f64>; ComparedQuantity::NAMES.len()],
    pub divergences: [Divergence; ComparedQuantity::NAMES.len()],
    /// Counter that changes when rows are removed.
    pub epoch: u64,
}

impl Comparison {
    /// Compares the steps that are new since the last call; restarts if a run was replaced.
    pub fn read(&mut self, reference: &RunRecord, run: &RunRecord) {
        let shrunk = self.read.0 > reference.steps.len() || self.read.1 > run.steps.len();
        if self.runs != Some((reference.id, run.id)) || shrunk {
            let same_camera = reference.camera_key == run.camera_key;
            let epoch = self.epoch + 1;
            *self = Self { runs: Some((reference.id, run.id)), same_camera, epoch, ..Self::default() };
        }
        while let (Some(a), Some(b)) = (reference.steps.get(self.read.0), run.steps.get(self.read.1)) {
            let (at, other) = (a.report.stamp_ns, b.report.stamp_ns);
            self.read.0 += usize::from(at <= other);
            self.read.1 += usize::from(other <= at);
            if at == other {
                self.push(a, b);
            }
        }
    }

    /// Compares a trajectory with a run at the stamps of the run's steps, in position and attitude, the only quantities
    /// of a trajectory. Only the new steps are read; restarts if one of the two was replaced.
    pub fn read_trajectory(&mut self, reference: &RunRecord, lane: &TrajectoryLane) {
        let ids = Some((reference.id, lane.id));
        if self.runs != ids || self.read.0 > reference.steps.len() {
            *self = Self { runs: ids, epoch: self.epoch + 1, ..Self::default() };
        }
        while let Some(step) = reference.steps.get(self.read.0) {
            self.read.0 += 1;
            let Some(pose) = lane.track.at(step.report.stamp_ns) else { continue };
            let reference_pose = step.report.newest().map(|newest| newest.world_from_imu);
            self.align_at(reference_pose.as_ref(), Some(&pose));
            let differences = |gauge: &RigidTransform, quantity: ComparedQuantity| match (reference_pose, quantity) {
                (Some(reference_pose), ComparedQuantity::Position) => {
                    Some((gauge.transform(&pose.translation_m) - reference_pose.translation_m).norm())
                }
                (Some(reference_pose), ComparedQuantity::Attitude) => {
                    Some(angle(&reference_pose.rotation, &(gauge.rotation * pose.rotation)))
                }
                _ => None,
            };
            self.push_row(step.report.stamp_ns, differences);
        }
    }

    fn push(&mut self, a: &StepRecord, b: &StepRecord) {
        let [reference_pose, other] = [a, b].map(|step| step.report.newest().map(|newest| &newest.world_from_imu));
        self.align_at(reference_pose, other);
        let same_camera = self.same_camera;
        self.push_row(a.report.stamp_ns, |gauge, quantity| {
            let comparable = same_camera || quantity.is_of_the_vehicle();
            quantity.difference(a, b, gauge).filter(|_| comparable)
        });
    }

    /// Aligns the worlds at the first stamp at which both have a pose.
    fn align_at(&mut self, reference_pose: Option<&RigidTransform>, other: Option<&RigidTransform>) {
        if self.gauge.is_none()
            && let (Some(reference_pose), Some(other)) = (reference_pose, other)
        {
            self.gauge = Some(yaw_and_position(reference_pose, other));
        }
    }

    /// Appends the differences at a stamp; `difference` is a function of the alignment of the other world.
    fn push_row(&mut self, stamp_ns: i64, difference: impl Fn(&RigidTransform, ComparedQuantity) -> Option<f64>) {
        self.stamps_ns.push(stamp_ns);
        let gauge = self.gauge.unwrap_or_default();
        for (index, quantity) in ComparedQuantity::all().enumerate() {
            let apart = difference(&gauge, quantity);
            self.columns[index].push(apart.unwrap_or(f64::NAN));
            let Some(apart) = apart else { continue };
            let divergence = &mut self.divergences[index];
            // Without the gauge transform, because its rounding errors are not a difference between the runs.
            if divergence.exact_ns.is_none() {
                let as_they_are = difference(&RigidTransform::default(), quantity);
                divergence.exact_ns = as_they_are.filter(|apart| *apart != 0.0).map(|_| stamp_ns);
            }
            if apart >= quantity.notable() {
                divergence.notable_ns.get_or_insert(stamp_ns);
            }
            if divergence.largest.is_none_or(|(largest, _)| apart > largest) {
                divergence.largest = Some((apart, stamp_ns));
            }
        }
    }

    /// The difference at the last common stamp at or before `stamp_ns`.
    pub fn at(&self, quantity: ComparedQuantity, stamp_ns: i64) -> Option<f64> {
        let row = self.stamps_ns.partition_point(|stamp| *stamp <= stamp_ns).checked_sub(1)?;
        self.column(quantity).get(row).copied().filter(|apart| apart.is_finite())
    }

    /// The differences of a quantity by row.
    pub fn column(&self, quantity: ComparedQuantity) -> &[f64] {
        &self.columns[quantity as usize]
    }

    pub fn divergence(&self, quantity: ComparedQuantity) -> &Divergence {
        &self.divergences[quantity as usize]
    }

    /// Stamp of the first difference in any quantity, and the quantity.
    pub fn first_exact(&self) -> Option<(i64, ComparedQuantity)> {
        self.first(|divergence| divergence.exact_ns)
    }

    /// Stamp of the first notable difference in any quantity, and the quantity.
    pub fn first_notable(&self) -> Option<(i64, ComparedQuantity)> {
        self.first(|divergence| divergence.notable_ns)
    }

    fn first(&self, of: impl Fn(&Divergence) -> Option<i64>) -> Option<(i64, ComparedQuantity)> {
        let known = self.divergences.iter().zip(ComparedQuantity::all());
        known
            .filter_map(|(divergence, quantity)| Some((of(divergence)?, quantity)))
            .min_by_key(|(stamp_ns, _)| *stamp_ns)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::session::tests::memory::recorded;
    use crate::simulation::{SyntheticFlight, SyntheticOptions, synthetic_tracks};

    fn flight() -> SyntheticFlight {
        synthetic_tracks(&SyntheticOptions { duration_s: 5.0, ..SyntheticOptions::default() })
    }

    #[test]
    fn a_run_against_itself_never_diverges() {
        let run = recorded(&flight(), "auto");
        let mut comparison = Comparison::default();
        comparison.read(&run, &run);
        assert_eq!(comparison.stamps_ns.len(), run.steps.len());
        assert_eq!((comparison.first_exact(), comparison.first_notable()), (None, None));
        let end_ns = run.steps.last().unwrap().report.stamp_ns;
        assert_eq!(comparison.at(ComparedQuantity::Position, end_ns), Some(0.0));
        assert_eq!(comparison.at(ComparedQuantity::Position, -1), None);
        assert!(ComparedQuantity::all().enumerate().all(|(index, quantity)| index == quantity as usize));
    }

    #[test]
    fn a_change_diverges_at_its_frame_and_nowhere_else() {
        let run = recorded(&flight(), "auto");
        let mut other = run.clone();
        let at = run.steps.len() - 20;
        for (number, step) in other.steps.iter_mut().enumerate().skip(at) {
            let newest = std::sync::Arc::make_mut(step).report.window.last_mut().unwrap();
            newest.world_from_imu.translation_m.x += 0.004 * (number - at + 1) as f64;
        }
        other.id += 1;
        let mut comparison = Comparison::default();
        // The result is the same if the runs are read while they grow.
        let mut growing = other.clone();
        growing.steps.truncate(at + 3);
        comparison.read(&run, &growing);
        comparison.read(&run, &other);
        let stamp_ns = |number: usize| run.steps[number].report.stamp_ns;
        assert_eq!(comparison.first_exact(), Some((stamp_ns(at), ComparedQuantity::Position)));
        assert_eq!(comparison.first_notable(), Some((stamp_ns(at + 2), ComparedQuantity::Position)));
        let divergence = comparison.divergence(ComparedQuantity::Position);
        let (largest, largest_ns) = divergence.largest.unwrap();
        assert!((largest - 0.08).abs() < 1e-9 && largest_ns == stamp_ns(at + 19), "{divergence:?}");
        assert_eq!(comparison.at(ComparedQuantity::Velocity, stamp_ns(at + 19)), Some(0.0));
        let epoch = comparison.epoch;
        comparison.read(&run, &run);
        assert!(comparison.epoch > epoch && comparison.first_exact().is_none());
    }

    #[test]
    fn a_trajectory_is_compared_in_position_and_attitude() {
        use crate::sensors::{PoseSample, PoseTrack};

        let run = recorded(&flight(), "auto");
        let world = RigidTransform::new(
            UnitQuaternion::from_axis_angle(&nalgebra::Vector3::z_axis(), -0.7),
            nalgebra::Vector3::new(1.0, 2.0, 3.0),
        );
        let last = run.steps.len() - 1;
        let samples = run.steps.iter().enumerate().filter_map(|(number, step)| {
            let mut pose = step.report.newest()?.world_from_imu;
            pose.translation_m.y += if number == last { 0.5 } else { 0.0 };
            Some(PoseSample { stamp_ns: step.report.stamp_ns, world_from_imu: world * pose })
        });
        let lane = TrajectoryLane::new("a".into(), "a.tum".into(), PoseTrack::new(samples.collect()), None);
        let mut comparison = Comparison::default();
        comparison.read_trajectory(&run, &lane);
        comparison.read_trajectory(&run, &lane);
        let end_ns = run.steps[last].report.stamp_ns;
        assert_eq!(comparison.first_notable(), Some((end_ns, ComparedQuantity::Position)));
        assert!((comparison.at(ComparedQuantity::Position, end_ns).unwrap() - 0.5).abs() < 1e-9);
        assert!(comparison.at(ComparedQuantity::Attitude, end_ns).unwrap() < 1e-9);
        assert!(comparison.column(ComparedQuantity::Velocity).iter().all(|apart| apart.is_nan()));
    }

    #[test]
    fn another_gauge_is_no_difference_and_another_parameterization_is_a_small_one() {
        let flight = flight();
        let run = recorded(&flight, "auto");
        let mut rotated = run.clone();
        let world = RigidTransform::new(
            UnitQuaternion::from_axis_angle(&nalgebra::Vector3::z_axis(), 1.0),
            nalgebra::Vector3::new(3.0, -2.0, 1.0),
        );
        for step in &mut rotated.steps {
            for frame in &mut std::sync::Arc::make_mut(step).report.window {
                frame.world_from_imu = world * frame.world_from_imu;
                frame.velocity_m_per_s = world.rotation * frame.velocity_m_per_s;
            }
        }
        rotated.id += 1;
        let mut comparison = Comparison::default();
        comparison.read(&run, &rotated);
        assert_eq!(comparison.first_notable(), None);
        assert!(comparison.column(ComparedQuantity::Position).iter().all(|apart| apart.is_nan() || *apart < 1e-9));

        let classical = recorded(&flight, "classical");
        comparison.read(&run, &classical);
        let (_, first) = comparison.first_exact().unwrap();
        assert!(!matches!(first, ComparedQuantity::Phase | ComparedQuantity::Tracks), "{first:?}: they begin alike");
        let end_ns = run.steps.last().unwrap().report.stamp_ns;
        assert!(comparison.at(ComparedQuantity::Position, end_ns).unwrap() < 0.02);
    }
}
