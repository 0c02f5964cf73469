//! Columns of sensors: derivatives, ranks and null directions.

mod derivatives;
mod excitation;
mod golden;
mod moves;
mod symmetries;
mod table;
