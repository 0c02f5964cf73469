//! IMU samples of a log: a filter of values that no sensor measured, and the merge of gyroscope and accelerometer topics.

pub(crate) mod filter;
pub(crate) mod merge;
