//! Faults of measurements and rigs: one table of their kinds, their application to measurements and its inverse, their
//! sentences, and the ranking of explanations.
//!
//! - `fault`: a fault with its values.
//! - `table`: a row per kind.
//! - `grammar`: the text of a fault in the changes of a fork.
//! - `joint_unit`: units in which drivers report joint angles.
//! - `sentence`: statement and remedy.
//! - `ranking`: criterion of explanations, and those that remain.
//! - `apply`: correction of measurements by a fault; the inverse fault plants it.

mod apply;
mod fault;
mod grammar;
mod joint_unit;
mod ranking;
mod sentence;
mod table;

pub use apply::{JointMap, LensChange, check_joints, correct_joint_angles, joint_maps};
pub use fault::{Choice, Fault, ImageFlip, ImageHalf};
pub use joint_unit::JointUnit;
pub use ranking::{Explanation, MOST_REMAINING, criterion};
pub use sentence::{Sentence, Severity, Subject};
pub use table::{Area, Change, Correction, FaultKind, LONGEST_SHIFT_S, Parameter, Part, Row, Sensor, TABLE};
