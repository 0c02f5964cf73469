//! Integration tests, a module per feature.

mod evaluate;
