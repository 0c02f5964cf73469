//! The expected tables of docs/mathematics.md, suggested excitation, and chains moved along null directions.

mod excitation;
mod expected_table;
mod experiments;
mod slide;
