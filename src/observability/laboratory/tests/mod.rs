//! The truth table of the mathematics, suggested excitation, and chains moved along null directions.

mod excitation;
mod experiments;
mod slide;
mod truth_table;
