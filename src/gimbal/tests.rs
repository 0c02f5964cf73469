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
