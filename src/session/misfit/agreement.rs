//! Agreement of residuals with their noise, and the step at which it ends.

use serde::Serialize;

use super::step_misfit::{Misfit, StepMisfit};

/// Quantity whose mean over a run shows whether residuals agree with their noise.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct AgreementValue {
    /// Name with the unit.
    pub name: &'static str,
    pub value: f64,
    /// Limit above which the residuals disagree.
    pub limit: f64,
}

impl AgreementValue {
    /// True if the value is within its limit.
    pub fn agrees(&self) -> bool {
        self.value <= self.limit
    }
}

/// Limits of the means over a run. Most rows of IMU factors and of the prior are fitted by the states: sound simulated and
/// real logs have 0.005 to 0.2 and 0.1 to 0.5, encoder readings 0.8 to 1, and residuals of 0.05 to 0.2 px in the median.
const IMAGE_LIMIT_PX: f64 = 0.5;
const FACTOR_LIMITS: [(&str, f64); 3] =
    [("IMU χ² per row", 0.5), ("encoders χ² per row", 1.6), ("marginalization prior χ² per row", 0.7)];
/// Length in pixels and largest ratio of the residuals above it, rejected ones included: 0.01 to 0.04 on sound logs.
const LONG_PX: f64 = 2.0;
const LONG_LIMIT: f64 = 0.1;
/// Limit of the ratio of tracked features that the solve does not accept.
const UNUSED_LIMIT: f64 = 0.35;
/// Limit of the ratio of images without a pose after the first one.
const LOST_LIMIT: f64 = 0.1;
/// Steps over which residuals are averaged for the onset of a disagreement.
const ONSET_STEPS: usize = 10;
/// Steps after the first window that are not looked at, and steps with agreement before an onset: without them the
/// disagreement began with the run.
const SETTLING_STEPS: usize = 6;
const STEPS_BEFORE: usize = 8;
/// Steps for which a disagreement lasts, and its ratio to the limit of the whole run: short parts vary more.
const LASTING_STEPS: usize = 25;
const LASTING_RATIO: f64 = 1.5;

/// Values of a run with their limits.
pub(in crate::session) fn values(misfit: &Misfit) -> Vec<AgreementValue> {
    let mut all = vec![
        AgreementValue { name: "images without a pose", value: 1.0 - misfit.tracked_ratio(), limit: LOST_LIMIT },
        AgreementValue {
            name: "reprojection residual, median in px",
            value: misfit.median_px().unwrap_or(0.0),
            limit: IMAGE_LIMIT_PX,
        },
        AgreementValue {
            name: "reprojection residuals above 2 px, ratio",
            value: misfit.pixels.ratio_above(LONG_PX),
            limit: LONG_LIMIT,
        },
        AgreementValue {
            name: "tracked features without a landmark, ratio",
            value: misfit.features.saturating_sub(misfit.inliers) as f64 / misfit.features.max(1) as f64,
            limit: UNUSED_LIMIT,
        },
    ];
    let factors = FACTOR_LIMITS.iter().zip(misfit.factors).filter(|(_, factor)| factor.rows > 0.0);
    all.extend(factors.map(|((name, limit), factor)| AgreementValue {
        name,
        value: factor.mean_square(),
        limit: *limit,
    }));
    all
}

/// Largest ratio of a value to its limit; at most 1 if the residuals agree with their noise.
pub(in crate::session) fn disagreement(misfit: &Misfit) -> f64 {
    if misfit.steps == 0 {
        return f64::INFINITY;
    }
    values(misfit).iter().map(|value| value.value / value.limit).fold(0.0, f64::max)
}

/// True if the residuals agree with their noise, as a whole and in every part of the run.
pub(in crate::session) fn agrees(misfit: &Misfit, steps: &[StepMisfit]) -> bool {
    disagreement(misfit) <= 1.0 && lasting(&means(steps), 0).is_none()
}

/// Index of the step from which on the residuals disagree with their noise, after steps with agreement; `None` if they
/// agree, or disagree from the start.
pub(in crate::session) fn onset(steps: &[StepMisfit]) -> Option<usize> {
    let means = means(steps);
    // The values of the first window settle.
    let settled = means.iter().position(Option::is_some)? + SETTLING_STEPS;
    let place = lasting(&means, settled)?;
    let agreed = means[settled.min(place)..place].iter().filter(|mean| mean.is_some_and(|mean| mean <= 1.0)).count();
    let disagrees = |step: &usize| disagreement(&Misfit::of_all(&steps[*step..=*step])) > 1.0;
    (agreed >= STEPS_BEFORE).then(|| (place..place + ONSET_STEPS).find(disagrees).unwrap_or(place))
}

/// Index of the step from which on the residuals agree with their noise again; `None` if they disagree up to the end.
pub(in crate::session) fn end(steps: &[StepMisfit]) -> Option<usize> {
    let means = means(steps);
    let after = means.iter().rposition(|mean| mean.is_some_and(|mean| mean > 1.0))? + 1;
    let agreeing = means[after..].iter().filter(|mean| mean.is_some()).count();
    (agreeing >= LASTING_STEPS).then_some((after + ONSET_STEPS).min(steps.len() - 1))
}

/// Disagreement of some consecutive steps from each step on; `None` where a step has no window.
fn means(steps: &[StepMisfit]) -> Vec<Option<f64>> {
    let mean = |some: &[StepMisfit]| some.iter().all(|step| step.tracking).then(|| disagreement(&Misfit::of_all(some)));
    steps.windows(ONSET_STEPS).map(mean).collect()
}

/// First place from `from` on with a disagreement that lasts.
fn lasting(means: &[Option<f64>], from: usize) -> Option<usize> {
    let disagrees = |mean: &Option<f64>| mean.is_some_and(|mean| mean > LASTING_RATIO);
    (from..means.len().saturating_sub(LASTING_STEPS)).find(|place| {
        let next = &means[*place..*place + LASTING_STEPS];
        disagrees(&next[0]) && next.iter().filter(|mean| disagrees(mean)).count() * 5 >= LASTING_STEPS * 4
    })
}

#[cfg(test)]
mod tests {
    use super::super::step_misfit::FactorMisfit;
    use super::*;

    fn steps(encoder: impl Fn(usize) -> f64) -> Vec<StepMisfit> {
        let step = |number: usize| {
            let mut step = StepMisfit {
                stamp_ns: number as i64 * 50_000_000,
                tracking: number >= 20,
                frames: 11,
                window_s: 2.0,
                ..StepMisfit::default()
            };
            (0..50).for_each(|_| step.pixels.add(0.1));
            (step.features, step.inliers) = (50, 48);
            step.factors = [(30.0, 150.0), (33.0 * encoder(number), 33.0), (10.0, 60.0)]
                .map(|(chi2, rows)| FactorMisfit { chi2, rows });
            step
        };
        (0..200).map(step).collect()
    }

    #[test]
    fn a_disagreement_has_a_name_and_an_onset() {
        let sound = steps(|_| 0.9);
        assert!(disagreement(&Misfit::of(&sound, 0)) < 1.0);
        assert_eq!(onset(&sound), None);
        assert!(agrees(&Misfit::of(&sound, 0), &sound));
        let always = steps(|_| 9.0);
        let found = Misfit::of(&always, 1_000_000_000);
        let wrong: Vec<&str> = values(&found).iter().filter(|it| !it.agrees()).map(|it| it.name).collect();
        assert_eq!(wrong, ["encoders χ² per row"]);
        assert_eq!(onset(&always), None);
        let later = onset(&steps(|number| if number < 120 { 0.9 } else { 30.0 })).unwrap();
        assert!((120..124).contains(&later), "{later}");
        assert_eq!((end(&always), end(&sound)), (None, None));
        let again = end(&steps(|number| if (80..120).contains(&number) { 30.0 } else { 0.9 })).unwrap();
        assert!((119..135).contains(&again), "{again}");
    }
}
