//! Values that panels derive from the steps of the runs, kept between the frames.

pub(super) mod answers;
pub(super) mod chain_values;
pub(super) mod flight;
pub(super) mod follow;
pub(super) mod reading;
pub(super) mod slide;
pub(super) mod step_advice;
pub(super) mod step_work;
