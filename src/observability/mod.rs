//! Observability of the calibration, from the Jacobian of a step.
//!
//! [`analyse`] takes the linearization of a step, projects all unknowns but the calibration out, scales the
//! columns so that angles and lengths are comparable, and derives two ranks from the singular values. The
//! structural rank counts singular values that are not zero. The informed rank counts directions in which the
//! measurements are more precise than the scale.
//! Motions on real logs are never exactly degenerate, so that only the informed rank shows them; the structural
//! rank shows what a parameterization can never make observable.

mod analysis;
mod classification;
mod correlation;
mod determination;
mod direction_words;
mod directions;
mod elimination;
mod factor;
mod flight_sigmas;
mod information;
pub mod laboratory;
mod parameter_state;
mod persistence;
mod redundancy;
mod report;
mod slide;
mod slide_direction;
mod stretches;
mod structure;
#[cfg(test)]
mod tests;

pub use analysis::{ScalingRule, analyse, analyse_with_scaling};
pub use correlation::Correlations;
pub use determination::{Determination, LossCause, WEAKLY_DETERMINED_RATIO};
pub use direction_words::{parameters_of, parameters_of_weights};
pub use factor::PackedFactor;
pub use information::{InformationRate, ParameterRate, information_rate};
pub use parameter_state::{ParameterState, exciting_motion, parameter_states};
pub use persistence::steps_lost;
pub use redundancy::Redundancy;
pub use report::{CalibrationDirection, Deficit, RankReport};
pub use slide::{ChainSlide, chain_of_step, slide};
pub use slide_direction::{InvalidSlide, SlideDirection, SlidePosition, SlideRequest};
pub use stretches::{InformationTrack, UsefulStretch, UsefulStretches};
pub use structure::{KnownDirection, KnownLoss, MIN_SPURIOUS_GAIN, known_losses};
