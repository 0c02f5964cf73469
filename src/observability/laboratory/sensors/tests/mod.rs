//! Columns of sensors: derivatives, ranks and null directions.

mod derivatives;
mod golden;
mod symmetries;
mod table;
