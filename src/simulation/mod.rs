//! Synthetic flights with known truth, written as flight logs.
