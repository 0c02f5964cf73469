mod comparison;
mod job;
mod perturbation;
mod plan;
mod summary_table;
mod table;
