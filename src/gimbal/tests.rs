mod conversions;
mod derivatives;
pub(crate) mod golden;
mod priors;
pub(crate) mod random;
