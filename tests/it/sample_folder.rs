//! Folder with the sample log and a plan, for tests that run a study.

use std::fs;
use std::path::Path;

/// Copies the sample log with its rigs into a folder and writes a plan there.
pub(crate) fn fill(folder: &Path, plan: &str) {
    let samples = Path::new(env!("CARGO_MANIFEST_DIR")).join("sample_logs");
    for name in ["garden.mcap", "garden.rig.yaml", "garden.truth.yaml"] {
        fs::copy(samples.join(name), folder.join(name)).expect("the sample can be copied");
    }
    fs::write(folder.join("plan.toml"), plan).expect("a file in a new folder");
}
