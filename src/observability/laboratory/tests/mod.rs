//! The tables of docs/mathematics.md, sections 7 and 9, suggested excitation, and chains moved along null directions.

mod excitation;
mod expected_table;
mod experiments;
mod slide;
