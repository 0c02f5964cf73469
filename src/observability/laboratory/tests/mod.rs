//! The truth table, and advice that is flown.

mod excitation;
mod table;
