//! Checklist of an initialization attempt: each check with its value and threshold.

/// One check with its measured value and threshold.
#[derive(Clone, Debug, PartialEq)]
pub struct WaitReason {
    /// Constant name for files and tests.
    pub test: &'static str,
    /// Reason for waiting (or result, when passed), with units.
    pub message: String,
    pub value: f64,
    /// Limit that `value` is compared with.
    pub threshold: f64,
}

#[derive(Clone, Debug, Default)]
pub(super) struct Checklist {
    pub(super) failed: Vec<WaitReason>,
    pub(super) passed: Vec<WaitReason>,
}

/// Unit of a displayed value.
#[derive(Clone, Copy, Debug)]
pub(super) enum Shown {
    Plain(&'static str),
    /// Radians, shown as degrees.
    Degrees,
    /// A ratio, shown in percent.
    Percent,
}

impl Shown {
    fn text(self, value: f64) -> String {
        // An empty sum is −0.
        let value = value + 0.0;
        match self {
            Self::Plain(unit) if value.fract() == 0.0 => format!("{value:.0}{unit}"),
            Self::Plain(unit) => format!("{value:.3}{unit}"),
            Self::Degrees => format!("{:.2}°", value.to_degrees()),
            Self::Percent => format!("{:.1} %", 100.0 * value),
        }
    }
}

impl Checklist {
    /// Checks that the value reaches the threshold.
    pub(super) fn at_least(
        &mut self,
        test: &'static str,
        subject: &str,
        value: f64,
        threshold: f64,
        shown: Shown,
    ) -> bool {
        self.decide(test, subject, value, threshold, shown, value >= threshold, "at least")
    }

    /// Checks that the value does not exceed the threshold.
    pub(super) fn at_most(
        &mut self,
        test: &'static str,
        subject: &str,
        value: f64,
        threshold: f64,
        shown: Shown,
    ) -> bool {
        self.decide(test, subject, value, threshold, shown, value <= threshold, "at most")
    }

    #[expect(clippy::too_many_arguments, reason = "private, and both callers pass them on")]
    fn decide(
        &mut self,
        test: &'static str,
        subject: &str,
        value: f64,
        threshold: f64,
        shown: Shown,
        passed: bool,
        relation: &str,
    ) -> bool {
        let message = format!("{subject}: {} ({relation} {} required)", shown.text(value), shown.text(threshold));
        let reason = WaitReason { test, message, value, threshold };
        if passed {
            self.passed.push(reason);
        } else {
            self.failed.push(reason);
        }
        passed
    }

    /// True if no check has failed.
    pub(super) fn all_passed(&self) -> bool {
        self.failed.is_empty()
    }
}
