//! Writes the seed corpus.
//!
//! `cargo run --release --manifest-path fuzz/Cargo.toml --bin seeds -- fuzz/corpus`

use std::path::Path;

use libfuzzer_sys as _; // defines the functions that the coverage counters call

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let corpus = std::env::args_os().nth(1).ok_or("give the folder of the corpus")?;
    dcvins_fuzz::seeds::write(Path::new(&corpus))
}
