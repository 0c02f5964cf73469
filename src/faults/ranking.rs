//! Ranking of explanations of a misfit by what they explain against their number of parameters.

/// Largest number of explanations that remain beside each other.
pub const MOST_REMAINING: usize = 3;

/// Criterion of an explanation (BIC), lower is better: −2·ln of its likelihood, and the logarithm of the number of
/// measurements for each parameter that it takes from them.
pub fn criterion(deviance: f64, parameters: f64, measurements: f64) -> f64 {
    deviance + parameters * measurements.ln()
}

/// Explanation with its criterion.
pub trait Explanation: Sized {
    fn criterion(&self) -> f64;

    /// True if the other one is a special case of this one, or differs from it in values only: by fitting as well this one
    /// does not exclude it.
    fn contains(&self, other: &Self) -> bool;

    /// The best explanation; `None` without one.
    fn best<'a>(all: impl IntoIterator<Item = &'a Self>) -> Option<&'a Self>
    where
        Self: 'a,
    {
        all.into_iter().min_by(|one, other| one.criterion().total_cmp(&other.criterion()))
    }

    /// Sorts explanations, the best one first.
    fn sort(all: &mut [Self]) {
        all.sort_by(|one, other| one.criterion().total_cmp(&other.criterion()));
    }

    /// Number of the explanation that precedes all others of a sorted list: the best one, or its best special case that is
    /// possible and worse by less than the margin.
    fn preferred(sorted: &[Self], margin: f64, is_possible: impl Fn(&Self) -> bool) -> usize {
        let Some(best) = sorted.first() else { return 0 };
        let is_special = |it: &Self| best.contains(it) && !it.contains(best);
        let is_near = |it: &Self| it.criterion() < best.criterion() + margin;
        sorted.iter().position(|it| is_special(it) && is_near(it) && is_possible(it)).unwrap_or(0)
    }

    /// Others that are worse than this one by less than the margin and do not contain it.
    fn rivals<'a>(&self, all: &'a [Self], margin: f64) -> impl Iterator<Item = &'a Self> {
        all.iter().filter(move |other| other.criterion() < self.criterion() + margin && !other.contains(self))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::faults::FaultKind;

    struct Candidate(FaultKind, f64);

    impl Explanation for Candidate {
        fn criterion(&self) -> f64 {
            self.1
        }

        fn contains(&self, other: &Self) -> bool {
            self.0 == other.0 || self.0.contains(other.0)
        }
    }

    #[test]
    fn a_special_case_precedes_and_has_no_rival_in_its_general_case() {
        let mut all = [
            Candidate(FaultKind::Mount, 40.0),
            Candidate(FaultKind::Focal, 15.0),
            Candidate(FaultKind::Intrinsics, 10.0),
        ];
        Candidate::sort(&mut all);
        assert_eq!(Candidate::preferred(&all, 20.0, |_| true), 1);
        assert_eq!(Candidate::preferred(&all, 2.0, |_| true), 0);
        assert_eq!(Candidate::preferred(&all, 20.0, |_| false), 0);
        assert_eq!(all[1].rivals(&all, 20.0).count(), 0);
        assert_eq!(all[1].rivals(&all, 30.0).count(), 1);
        assert_eq!(all[0].rivals(&all, 20.0).count(), 1);
    }
}
