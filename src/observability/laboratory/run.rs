//! Runs of an experiment: its linearization in each parameterization, analysed like a step of a run.

use super::experiment::{LaboratoryForm, LaboratoryResult, LaboratorySetup};
use super::sensors::linearize_sensors;
use crate::observability::analyse;

impl LaboratorySetup {
    /// Runs the experiment in one parameterization; `None` when a value of the mechanism is not finite.
    pub fn run(&self, form: LaboratoryForm) -> Option<LaboratoryResult> {
        self.run_all(&[form]).pop()
    }

    /// Runs the experiment in several parameterizations; those with values that are not finite are omitted.
    pub fn run_all(&self, forms: &[LaboratoryForm]) -> Vec<LaboratoryResult> {
        let mut results = Vec::new();
        self.run_each(forms, |result| {
            results.push(result);
            true
        });
        results
    }

    /// [`Self::run_all`] with a callback for each result as soon as it is ready; stops when `each` returns `false`.
    pub fn run_each(&self, forms: &[LaboratoryForm], mut each: impl FnMut(LaboratoryResult) -> bool) {
        let window = (!self.columns.any()).then(|| self.window());
        let flight = self.flight();
        let angles: Vec<Vec<f64>> = (0..self.frames).map(|slot| flight.joints_rad(Self::time_s(slot))).collect();
        let free = self.joints_free();
        for form in forms {
            let chain = form.chain(&self.mechanism);
            let linearization = match &window {
                Some(window) => {
                    Some(window.linearize(&self.mechanism.chain, form.parameterization, form.joint_offsets))
                }
                None => linearize_sensors(self, *form),
            };
            let Some(linearization) = linearization else { continue };
            let Some(rank) = analyse(&linearization, &chain, &angles, free) else { continue };
            if !each(LaboratoryResult { form: *form, rank }) {
                return;
            }
        }
    }
}
