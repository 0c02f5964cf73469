mod comparison;
mod job;
mod perturbation;
mod plan;
mod table;
