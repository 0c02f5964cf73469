//! Faults in simulated measurements and rigs: the correction of a fork with the same text undoes them.

use nalgebra::Vector2;

use super::disturbances::Disturbances;
use super::error::SimulationError;
use crate::camera::CameraModel;
use crate::faults::{Fault, FaultKind, LensChange, Sensor, check_joints, correct_joint_angles};
use crate::geometry::{ns_from_seconds, seconds_from_ns};
use crate::sensors::{GrayImage, ImuSample, JointAngles, JointSample};
use crate::simulation::scenario::Scenario;

/// Faults of a simulation.
#[derive(Clone, Debug)]
pub(super) struct Planting {
    faults: Vec<Fault>,
    /// Corrections that plant the faults into sound measurements, in the order in which they are applied.
    planted: Vec<Fault>,
}

impl Planting {
    pub(super) fn of(disturbances: &Disturbances) -> Self {
        let of_keys = [
            Fault::new(FaultKind::CameraClock, &[-disturbances.camera_time_offset_s]),
            Fault::new(FaultKind::EncoderClock, &[disturbances.joint_lag_s]),
            Fault::new(FaultKind::Focal, &[1.0 + disturbances.focal_ratio]),
        ];
        // Corrections act in their order: the last one is planted first.
        let inverses = disturbances.faults.iter().rev().map(Fault::inverse);
        Self { faults: disturbances.faults.clone(), planted: of_keys.into_iter().chain(inverses).collect() }
    }

    /// Planted corrections that act at a time in seconds since the log began.
    fn acting(&self, time_s: f64) -> impl Iterator<Item = &Fault> {
        self.planted.iter().filter(move |fault| acts_at(fault, time_s))
    }

    /// Time offset of the cameras that the given rig lacks, in seconds.
    pub(super) fn camera_offset_s(&self) -> f64 {
        0.0 - self.planted.iter().map(|fault| fault.camera_shift_s(0.0)).sum::<f64>()
    }

    /// Plants the faults of the given rig and of the IMU.
    ///
    /// # Errors
    /// If the rig has no such joint.
    pub(super) fn plant(&self, scenario: &mut Scenario) -> Result<(), SimulationError> {
        let bad = |expected| SimulationError::BadDisturbance { text: "fault".to_owned(), expected };
        check_joints(&self.faults, &scenario.true_rig.joint_names()).map_err(bad)?;
        self.planted.iter().for_each(|fault| scenario.spoil_intrinsics(&fault.lens()));
        for sample in &mut scenario.imu_record.samples {
            let acting = self.acting(seconds_from_ns(sample.stamp_ns));
            *sample = acting.fold(*sample, |sample: ImuSample, fault| fault.imu_sample(&sample));
        }
        Ok(())
    }

    /// Plants the faults of the angles of joints with these names.
    pub(super) fn plant_angles(&self, names: &[String], sample: &mut JointSample) {
        let acting = self.acting(seconds_from_ns(sample.stamp_ns)).filter(|fault| fault.corrects(Sensor::Joints));
        let acting: Vec<Fault> = acting.cloned().collect();
        let angles_rad = std::mem::take(&mut sample.angles_rad);
        let mut angles = JointAngles { angles_rad, ..JointAngles::default() };
        correct_joint_angles(&acting, names, &mut angles);
        sample.angles_rad = angles.angles_rad;
    }

    /// Recorded stamp of joint angles of a time, both in nanoseconds since the log began.
    pub(super) fn joint_stamp_ns(&self, time_ns: i64) -> i64 {
        time_ns + ns_from_seconds(self.acting(seconds_from_ns(time_ns)).map(Fault::joint_shift_s).sum())
    }

    /// Camera at a time in seconds if its focal length differs from the one of its model.
    pub(super) fn zoomed(&self, model: &CameraModel, time_s: f64) -> Option<CameraModel> {
        let zooms = |fault: &&Fault| matches!(fault.kind, FaultKind::Zoom | FaultKind::FocalPeriod);
        let acting = self.faults.iter().filter(|fault| zooms(fault) && acts_at(fault, time_s));
        let factor = |fault: &Fault| fault.focal_factor(time_s - fault.since_s.unwrap_or(0.0));
        let lens = LensChange { focal: acting.map(factor).product(), ..LensChange::NONE };
        (lens != LensChange::NONE).then(|| lens.camera(model))
    }

    /// Mirrored or rotated image of a time in seconds.
    pub(super) fn flipped(&self, model: &CameraModel, time_s: f64, image: GrayImage) -> GrayImage {
        let flips = self.acting(time_s).filter(|fault| fault.kind == FaultKind::ImageFlip);
        flips.fold(image, |image, flip| {
            let grey = |index: usize| {
                let uv_px = Vector2::new((index % image.width) as f64, (index / image.width) as f64);
                let from_px = flip.pixel(model, uv_px, 0.0).unwrap_or(uv_px);
                image.pixels[from_px.y as usize * image.width + from_px.x as usize]
            };
            let pixels = (0..image.pixels.len()).map(grey).collect();
            GrayImage { pixels, ..image }
        })
    }
}

/// True if a fault acts at a time in seconds since the log began.
fn acts_at(fault: &Fault, time_s: f64) -> bool {
    fault.since_s.is_none_or(|since_s| time_s >= since_s)
}
