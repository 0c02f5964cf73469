use std::fmt;
use std::sync::{Arc, Weak};

use crate::estimator::allocated_bytes;
use crate::frontend::{FrontEndStatistics, TrackedFeature, TrackedFrame};

/// Feature tracks of one camera's image in a step. The record of a long run does not own them: a run keeps the newest in
/// memory and the others in a temporary file, from which they are read when they are drawn. Both are printed in the same
/// way.
#[derive(Clone)]
pub struct StepTracks {
    /// Header stamp of the image, in nanoseconds since the log began.
    pub stamp_ns: i64,
    pub statistics: FrontEndStatistics,
    /// Number of features in the image.
    pub count: usize,
    place: TracksPlace,
}

#[derive(Clone)]
enum TracksPlace {
    Own(Arc<TrackedFrame>),
    /// Tracks of a camera in the measurements of a step.
    Kept {
        in_memory: Weak<TrackedFrame>,
        all: Arc<dyn KeptTracks>,
        step: usize,
        camera: usize,
    },
}

/// Tracks of all steps of a run, in memory or in a file.
pub(in crate::session) trait KeptTracks: Send + Sync {
    /// Tracks of a camera in a step; `None` where they cannot be read.
    fn tracks(&self, step: usize, camera: usize) -> Option<Arc<TrackedFrame>>;
}

impl StepTracks {
    /// All tracks; without features if the file that has them cannot be read any more.
    pub fn frame(&self) -> Arc<TrackedFrame> {
        let found = match &self.place {
            TracksPlace::Own(tracks) => return Arc::clone(tracks),
            TracksPlace::Kept { in_memory, all, step, camera } => {
                in_memory.upgrade().or_else(|| all.tracks(*step, *camera))
            }
        };
        let (stamp_ns, statistics) = (self.stamp_ns, self.statistics);
        found.unwrap_or_else(|| Arc::new(TrackedFrame { stamp_ns, statistics, ..TrackedFrame::default() }))
    }

    /// True if both are the same tracks of one image, as two runs on one camera have them.
    pub fn is_same(&self, other: &Self) -> bool {
        self.address() == other.address()
    }

    /// Address of the tracks, which no other tracks have while this value exists, even when they are in the file.
    fn address(&self) -> *const TrackedFrame {
        match &self.place {
            TracksPlace::Own(tracks) => Arc::as_ptr(tracks),
            TracksPlace::Kept { in_memory, .. } => Weak::as_ptr(in_memory),
        }
    }

    /// Leaves the tracks to the measurements of the run's steps.
    pub(super) fn keep_in(&mut self, all: &Arc<dyn KeptTracks>, step: usize, camera: usize) {
        if let TracksPlace::Own(tracks) = &self.place {
            let in_memory = Arc::downgrade(tracks);
            self.place = TracksPlace::Kept { in_memory, all: Arc::clone(all), step, camera };
        }
    }

    /// Memory in bytes of the tracks that it owns.
    pub(super) fn own_bytes(&self) -> usize {
        match &self.place {
            TracksPlace::Own(tracks) => tracks_bytes(tracks),
            TracksPlace::Kept { .. } => 0,
        }
    }
}

impl fmt::Debug for StepTracks {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.frame().fmt(formatter)
    }
}

impl From<Arc<TrackedFrame>> for StepTracks {
    fn from(tracks: Arc<TrackedFrame>) -> Self {
        let (stamp_ns, statistics, count) = (tracks.stamp_ns, tracks.statistics, tracks.features.len());
        Self { stamp_ns, statistics, count, place: TracksPlace::Own(tracks) }
    }
}

/// Heap memory of one camera's tracks behind an [`Arc`], in bytes.
pub(in crate::session) fn tracks_bytes(tracks: &TrackedFrame) -> usize {
    allocated_bytes(size_of::<TrackedFrame>() + 2 * size_of::<usize>())
        + allocated_bytes((tracks.features.capacity() + tracks.matched.capacity()) * size_of::<TrackedFeature>())
}
