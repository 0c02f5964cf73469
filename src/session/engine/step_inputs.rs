//! What a step is given, kept so that it can be taken again.

use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};

use super::synchronized_frames::Instant;
use crate::estimator::allocated_bytes;
use crate::frontend::TrackedFrame;
use crate::geometry::RigidTransform;
use crate::sensors::{ImuSample, JointAngles};
use crate::session::record::tracks_bytes;

/// Everything that one step of a run was given.
///
/// The front end does not know the estimator, so its tracks are the same whatever the run does with them: they are kept,
/// and no image has to be tracked again.
#[derive(Clone, Debug, PartialEq)]
pub(in crate::session) struct Material {
    /// Number of the main camera's image; where it is missing, one that no image has.
    pub(in crate::session) frame_index: usize,
    /// Header stamp since the log began, on the main camera's clock.
    pub(in crate::session) stamp_ns: i64,
    /// Log time since the log began.
    pub(in crate::session) log_time_ns: i64,
    /// Inertial samples since the instant before.
    pub(in crate::session) imu: Vec<ImuSample>,
    /// Encoder angles at the stamp.
    pub(in crate::session) joint_angles: Option<JointAngles>,
    /// Tracks by camera of the run, the main one's first; empty ones where an image is missing.
    pub(in crate::session) tracks: Vec<Arc<TrackedFrame>>,
    /// True pose of the IMU.
    pub(in crate::session) truth: Option<RigidTransform>,
    /// What the front ends took.
    pub(in crate::session) frontend_ms: f64,
}

impl Material {
    /// What an instant brings to the estimator, without its images.
    pub(in crate::session) fn of(instant: &Instant) -> Self {
        let tracks = |camera: usize| instant.tracks(camera).map_or_else(Arc::default, Arc::clone);
        Self {
            frame_index: instant.frame_index(),
            stamp_ns: instant.stamp_ns(),
            log_time_ns: instant.log_time_ns(),
            imu: instant.imu().to_vec(),
            joint_angles: instant.joint_angles().cloned(),
            tracks: (0..instant.cameras()).map(tracks).collect(),
            truth: instant.truth(),
            frontend_ms: instant.frontend_ms(),
        }
    }

    /// The main camera's tracks.
    pub(in crate::session) fn main_tracks(&self) -> &Arc<TrackedFrame> {
        &self.tracks[0]
    }

    /// Bytes that it takes, without the main camera's tracks, which the step's record counts.
    pub(in crate::session) fn own_bytes(&self) -> usize {
        let rigid: usize = self.tracks.iter().skip(1).map(|tracks| tracks_bytes(tracks)).sum();
        allocated_bytes(size_of::<Self>() + 2 * size_of::<usize>())
            + allocated_bytes(self.imu.capacity() * size_of::<ImuSample>())
            + self.joint_angles.as_ref().map_or(0, |angles| allocated_bytes(angles.heap_bytes()))
            + rigid
    }
}

/// The material of a run's steps so far, which the runs that branch off from it share.
#[derive(Debug, Default)]
pub(in crate::session) struct Materials {
    state: Mutex<State>,
    grown: Condvar,
}

#[derive(Debug, Default)]
struct State {
    steps: Vec<Arc<Material>>,
    ended: bool,
}

impl Materials {
    fn lock(&self) -> MutexGuard<'_, State> {
        // Material is only ever pushed whole.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Adds the material of the next step.
    pub(in crate::session) fn push(&self, material: Arc<Material>) {
        self.lock().steps.push(material);
        self.grown.notify_all();
    }

    /// No more will come.
    pub(in crate::session) fn end(&self) {
        self.lock().ended = true;
        self.grown.notify_all();
    }

    /// The material of a step that has been taken.
    pub(in crate::session) fn get(&self, step: usize) -> Option<Arc<Material>> {
        self.lock().steps.get(step).cloned()
    }

    /// The material of a step; waits for it. `None` behind the last one.
    pub(in crate::session) fn wait_for(&self, step: usize) -> Option<Arc<Material>> {
        let waiting = self.grown.wait_while(self.lock(), |state| state.steps.len() <= step && !state.ended);
        waiting.unwrap_or_else(PoisonError::into_inner).steps.get(step).cloned()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whoever_waits_for_material_gets_it_or_the_end() {
        let materials = Arc::new(Materials::default());
        let waiting = Arc::clone(&materials);
        let reader = std::thread::Builder::new().spawn(move || {
            let mut seen = Vec::new();
            while let Some(material) = waiting.wait_for(seen.len()) {
                seen.push(material.stamp_ns);
            }
            seen
        });
        let reader = reader.unwrap();
        for stamp_ns in [10, 20, 30] {
            materials.push(Arc::new(Material {
                frame_index: 0,
                stamp_ns,
                log_time_ns: 0,
                imu: Vec::new(),
                joint_angles: None,
                tracks: vec![Arc::default()],
                truth: None,
                frontend_ms: 0.0,
            }));
        }
        materials.end();
        assert_eq!(reader.join().unwrap(), [10, 20, 30]);
        assert!(materials.get(3).is_none());
    }
}
