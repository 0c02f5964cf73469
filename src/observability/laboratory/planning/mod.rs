//! Planned motions: curves of joints and vehicle that leave the calibration with the smallest predicted σ.
//!
//! A motion is one spline per joint and per axis of the vehicle ([`MotionSplines`](crate::simulation::MotionSplines)).
//! Its information is summed over consecutive windows of the keyframes that the estimator would take, each linearized by
//! the factors of the estimator. The search adds bumps to the splines within the limits of joints and vehicle.

mod admitted;
mod by_hand;
mod keyframes;
mod limits;
mod moves;
mod objective;
mod plan;
mod planned_row;
mod problem;
mod search;
mod starts;
mod sufficient;
mod summary;
#[cfg(test)]
mod tests;
mod windows;

pub use by_hand::{HandPlan, HandStep};
pub use limits::{EnteredLimits, MotionLimits, ReachedLimit};
pub use objective::PlanCriterion;
pub use plan::{
    ListedComparison, MotionPlan, MotionPlanError, PLAN_DURATION_S, PLAN_SECONDS, PlanOptions, PlanStart, plan_by_hand,
    plan_motion,
};
pub use planned_row::PlannedRow;
pub use problem::{MotionPrediction, MotionPredictor, MotionProblem, MotionStart};
pub use search::move_point;
pub use starts::PLAN_KNOT_S;
pub use sufficient::{LONGEST_MOTION_S, NEXT_MOTION_S, SufficientMotion, sufficient_motion};
pub use summary::{PlanTable, PlannedParameter, SigmaRow};
pub use windows::{SCENE_M, scene_distances_m};
