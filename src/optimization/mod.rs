//! Shared parts of all least-squares problems: landmark with its triangulation, reprojection residual with its
//! Jacobians, robust loss, elimination of landmarks, normal equations, damped solver and Gauss–Newton.
//!
//! Residuals are predicted minus measured; poses are perturbed by the rule of [`crate::geometry`]. A problem has
//! separate unknowns and assembly: it linearizes observations by camera poses here (`reprojection`), eliminates the
//! landmarks by QR (`LandmarkRows`) or by the Schur complement (`ReprojectionEquations`), converts the result to its
//! unknowns, and is solved by `damped::minimize`.

mod cholesky;
pub mod damped;
mod landmark;
mod landmark_rows;
mod normal_equations;
mod pose_blocks;
pub(crate) mod reprojection;
mod robust_loss;
mod schur;
#[cfg(test)]
mod tests;
mod triangulation;
mod two_level;

pub(crate) use cholesky::{Cholesky, DIAGONAL_FLOOR};
pub(crate) use landmark::Landmark;
pub use landmark::LandmarkModel;
pub(crate) use landmark_rows::{LandmarkRows, OBSERVATION_ROWS};
pub use normal_equations::{
    MIN_PRIOR_VARIANCE, NormalEquations, damp, fix, gauss_newton, prior_square_root_information,
    square_root_information,
};
pub(crate) use pose_blocks::{BlockTerm, PoseBlocks, PoseBlocksOf};
pub(crate) use reprojection::{CameraPose, RelativePose, RelativePoses, Reprojection};
pub(crate) use robust_loss::LossSum;
pub use robust_loss::RobustLoss;
pub(crate) use schur::{DensePoseEquations, ReducedEquations, ReprojectionEquations, SparsePoseEquations};
pub(crate) use triangulation::{Ray, TriangulationOptions, triangulate};
pub(crate) use two_level::{TwoLevelEquations, TwoLevelPosterior, TwoLevelStep};
