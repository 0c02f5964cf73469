mod conversions;
mod derivatives;
pub(crate) mod golden;
mod priors;
pub(crate) mod random;

use super::{ParameterId, ParameterNames};

/// Parses a parameter name, with links by number: `L1.alpha`.
pub(crate) fn parameter(name: &str) -> ParameterId {
    ParameterNames::default().parse(name).unwrap_or_else(|| panic!("'{name}' is no parameter"))
}

#[test]
fn intrinsics_of_the_imu_are_shown_in_percent() {
    let value = |name: &str| parameter(name).shown().value(0.0125, 0.001);
    assert_eq!(["gyroscope.sx", "k1", "fx"].map(value), ["1.25 %", "0.0125", "0.0125 px"]);
}
