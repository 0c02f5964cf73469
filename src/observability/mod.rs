//! Which directions of the calibration the Jacobian cannot see.
//!
//! [`analyse`] takes a step's linearization: it projects everything but the calibration out, scales the columns so that
//! a metre and a radian compare, and reads two ranks off the singular values.
//! The structural rank counts what is not exactly zero; the informed one counts directions in which the window says more
//! than the scale says beforehand.
//! On real logs a degenerate motion is never exactly degenerate, so that only the second one shows it; the first one
//! shows what the parameterization can never tell.

mod analysis;
mod classification;
mod directions;
mod elimination;
mod factor;
mod information;
pub mod laboratory;
mod persistence;
mod report;
mod slide;
mod slide_direction;
mod structure;
#[cfg(test)]
mod tests;

pub use analysis::{ScalingRule, analyse, analyse_with_scaling};
pub use factor::PackedFactor;
pub use information::{InformationRate, ParameterRate, information_rate};
pub use persistence::steps_lost;
pub use report::{CalibrationDirection, RankReport};
pub use slide::{ChainSlide, chain_of_step, slide};
pub use slide_direction::{InvalidSlide, SlideDirection, SlidePosition, SlideRequest};
pub use structure::{KnownDirection, KnownLoss, MIN_SPURIOUS_GAIN, known_losses};
