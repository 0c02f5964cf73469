//! Laboratory: observability of the calibration parameters for a mechanism, a parameterization and a motion, without a
//! log.
//!
//! An experiment makes a hypothetical window, linearizes it with the estimator's own factors
//! ([`crate::estimator::HypotheticalWindow`]) and analyses it in the same way as a step of a run.
//! [`survey`](fn@survey) runs the built-in experiments.

mod advice;
mod excitation;
mod experiment;
mod experiments;
mod mechanism;
mod motion;
mod planning;
mod predicted_window;
mod report;
mod run;
mod sensor_columns;
mod sensors;
mod situation;
mod spurious;
mod survey;
#[cfg(test)]
mod tests;

pub use advice::{ADVICE_DURATION_S, Advice, CandidateReport, WeakDirection, advise};
pub use excitation::{Excitation, ParameterExcitation, excitation};
pub use experiment::{
    FRAME_PERIOD_S, LABORATORY_IMU, LaboratoryForm, LaboratoryResult, LaboratorySetup, PIXEL_SIGMA_PX,
};
pub use mechanism::{LaboratoryJoint, Mechanism, UnknownMechanism};
pub use motion::{LaboratoryMotion, UnknownMotion};
pub use planning::{
    EnteredLimits, HandPlan, HandStep, LONGEST_MOTION_S, ListedComparison, MotionLimits, MotionPlan, MotionPlanError,
    MotionPrediction, MotionPredictor, MotionProblem, MotionStart, NEXT_MOTION_S, PLAN_DURATION_S, PLAN_KNOT_S,
    PLAN_SECONDS, PlanCriterion, PlanOptions, PlanStart, PlanTable, PlannedParameter, PlannedRow, ReachedLimit,
    SCENE_M, SigmaRow, SufficientMotion, move_point, plan_by_hand, plan_motion, scene_distances_m, sufficient_motion,
};
pub use report::LaboratoryReport;
pub use sensor_columns::{SensorColumns, UnknownColumns};
pub use sensors::{
    ParameterSigmas, SensorExcitation, SensorSurveyEntry, SensorSurveyRow, SensorSurveySection, sensor_excitation,
};
pub use situation::Situation;
pub use spurious::SpuriousRow;
pub use survey::{DegeneracySurvey, MinFramesRow, SurveyEntry, SurveyRow, SurveySection, survey};
