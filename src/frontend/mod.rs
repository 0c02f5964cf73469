//! Front end: images in, feature tracks out.
//!
//! The front end depends on the camera and a predicted rotation only, not on the estimator: all runs of a comparison
//! use the same tracks.
//!
//! [`FrontEnd`] processes images in order. It predicts features by a [`PredictedRotation`] or, if that is inconsistent
//! with the images, by aligning coarse images, tracks them by [`lucas_kanade`], refines them against reference patches
//! ([`ReferenceOptions`]), rejects the [`outliers`] of the epipolar geometry, and adds new [`corners`].

mod appearance;
mod coarse;
pub mod corners;
mod epipolar;
mod filters;
mod front_end;
pub mod lucas_kanade;
pub mod outliers;
mod perspective;
mod prediction;
mod products;
mod pyramid;
pub mod readout;
mod reference;
mod resample;
mod responses;
mod stereo;
#[cfg(test)]
mod tests;
mod tracks;

pub use front_end::{FrontEnd, FrontEndError, FrontEndOptions};
pub use prediction::{
    ChainOrientation, PredictedRotation, PredictionNoise, RowRotations, camera_rates, predict_camera_rotation,
};
pub use pyramid::Pyramid;
pub use reference::ReferenceOptions;
pub use stereo::{StereoCamera, StereoMatcher, inverse_distance_per_m};
pub(crate) use tracks::ObservedPixel;
pub use tracks::{FeatureId, FrontEndStatistics, TrackedFeature, TrackedFrame};
