//! Parameters by their names, for the tests of this crate and of those that include this file by its path.

use crate::gimbal::{ParameterId, ParameterNames};

/// Parses a parameter name, with links by number: `L1.alpha`.
pub(crate) fn parameter(name: &str) -> ParameterId {
    ParameterNames::default().parse(name).unwrap_or_else(|| panic!("'{name}' is no parameter"))
}
