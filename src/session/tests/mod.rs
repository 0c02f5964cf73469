mod forks;
pub(super) mod memory;
mod plan;
mod warnings;
