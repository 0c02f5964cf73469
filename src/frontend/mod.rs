//! Image in, feature tracks out.
//!
//! The front end knows the camera and a predicted rotation, never the estimator: every run of a comparison sees the same
//! tracks.

mod tracks;

pub use tracks::{FeatureId, FrontEndStatistics, TrackedFeature, TrackedFrame};
