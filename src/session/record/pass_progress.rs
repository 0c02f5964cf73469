//! Progress of a run, including its passes before the recorded one.

use super::run::RunRecord;

/// Progress of a pass before the last one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PassProgress {
    /// Number of the pass, counted from 1.
    pub number: usize,
    /// Latest stamp of the pass, in nanoseconds since the log began.
    pub reached_ns: i64,
}

impl RunRecord {
    /// Computed fraction of the run, all passes together, from 0 to 1; `duration_ns` is that of the log.
    pub fn computed_fraction(&self, duration_ns: i64) -> f64 {
        let passes = self.spec.passes.max(1);
        let before = match self.running_pass() {
            Some(pass) => pass.number - 1,
            None if self.steps.is_empty() => 0,
            None => passes - 1,
        };
        let of_pass = (self.reached_ns() as f64 / duration_ns.max(1) as f64).clamp(0.0, 1.0);
        (before as f64 + of_pass) / passes as f64
    }

    /// "pass 1 of 2 " while a pass before the last one runs, else nothing.
    pub fn pass_text(&self) -> String {
        match self.running_pass() {
            Some(pass) => format!("pass {} of {} ", pass.number, self.spec.passes),
            None => String::new(),
        }
    }

    /// Latest stamp of the running pass, in nanoseconds since the log began.
    pub fn reached_ns(&self) -> i64 {
        let last_ns = self.steps.last().map_or(0, |step| step.report.stamp_ns);
        self.running_pass().map_or(last_ns, |pass| pass.reached_ns)
    }

    /// The pass before the last one that runs; `None` once the last pass has its first step.
    fn running_pass(&self) -> Option<PassProgress> {
        self.earlier_pass.filter(|_| self.steps.is_empty())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn progress_counts_all_passes() {
        let mut run = RunRecord::new("auto:passes=2".parse().unwrap(), "cam0".to_owned());
        assert_eq!((run.computed_fraction(1000), run.pass_text().as_str()), (0.0, ""));
        run.earlier_pass = Some(PassProgress { number: 1, reached_ns: 500 });
        assert_eq!((run.computed_fraction(1000), run.pass_text().as_str()), (0.25, "pass 1 of 2 "));
        run.spec.passes = 1;
        run.earlier_pass = Some(PassProgress { number: 1, reached_ns: 2000 });
        assert_eq!(run.computed_fraction(1000), 1.0);
        assert_eq!(run.computed_fraction(0), 1.0);
    }
}
