//! Image in, feature tracks out.
//!
//! The front end knows the camera and a predicted rotation, never the estimator: every run of a comparison sees the same
//! tracks.
//!
//! [`FrontEnd`] takes images one by one. It looks for the features it has where a [`PredictedRotation`] or, when that cannot
//! be trusted, the coarse images say, follows them by [`lucas_kanade`] and holds them to what they looked like at first
//! ([`KeyOptions`]), leaves out those that do not move with the scene ([`outliers`]), and fills the gaps with new
//! [`corners`].

mod appearance;
mod coarse;
pub mod corners;
mod front_end;
mod keyed;
pub mod lucas_kanade;
pub mod outliers;
mod prediction;
mod pyramid;
mod resample;
mod responses;
#[cfg(test)]
mod tests;
mod tracks;

pub use front_end::{FrontEnd, FrontEndError, FrontEndOptions};
pub use keyed::KeyOptions;
pub use prediction::{MountOrientation, PredictedRotation, PredictionNoise, predict_camera_rotation};
pub use pyramid::Pyramid;
pub use tracks::{FeatureId, FrontEndStatistics, TrackedFeature, TrackedFrame};
