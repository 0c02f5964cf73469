//! The truth table, advice that is flown, and chains that slide.

mod excitation;
mod slide;
mod table;
