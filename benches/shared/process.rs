//! Resources used by the process so far, if the system reports them.

use std::fs;

/// Clock ticks per second in `/proc`, which Linux fixes at a hundred for user space.
const TICKS_PER_S: f64 = 100.0;

/// Processor time of all threads so far, in seconds.
pub(crate) fn cpu_s() -> Option<f64> {
    let status = fs::read_to_string("/proc/self/stat").ok()?;
    // The name in brackets may contain spaces; user and system time are the 14th and 15th field.
    let fields: Vec<&str> = status.rsplit_once(')')?.1.split_whitespace().collect();
    let ticks = fields.get(11)?.parse::<f64>().ok()? + fields.get(12)?.parse::<f64>().ok()?;
    Some(ticks / TICKS_PER_S)
}
