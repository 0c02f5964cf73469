use serde::Serialize;

use super::{KnownDirection, PackedFactor};
use crate::estimator::allocated_bytes;
use crate::gimbal::{ParameterGroup, ParameterId, ParameterNames, Quantity, Singularity};

/// Ranks of the calibration block at one step, by the rule of docs/mathematics.md, section 8.
#[derive(Clone, Debug, PartialEq)]
pub struct RankReport {
    /// Parameters of the calibration columns.
    pub parameters: Vec<ParameterId>,
    /// Parameters fixed at their values: known, without columns.
    pub fixed_parameters: Vec<ParameterId>,
    /// Singular values of the prior-scaled, projected calibration columns, largest first, one per column.
    pub singular_values: Vec<f64>,
    /// Singular values with the rows of the priors included.
    pub singular_values_with_priors: Vec<f64>,
    /// Norm of the prior-scaled calibration columns before projection: the reference of the structural threshold.
    pub reference: f64,
    /// Singular values at or below this are structural zeros.
    pub structural_threshold: f64,
    /// Directions with a smaller singular value are uninformed (1: the posterior σ exceeds 0.71 of the scale).
    pub informed_threshold: f64,
    /// Number of singular values over the structural threshold.
    pub rank_structural: usize,
    /// Number of singular values at or over the informed threshold.
    pub rank_informed: usize,
    pub deficit_parameterization: usize,
    /// Deficit due to joints that did not move in the window.
    pub deficit_joints: usize,
    /// Deficit due to unknown joint angles.
    pub deficit_absorbed: usize,
    /// Deficit due to the motion of the vehicle.
    pub deficit_motion: usize,
    /// Null and uninformed directions, the least observable first.
    pub directions: Vec<CalibrationDirection>,
    pub margins: Vec<(Singularity, f64)>,
    /// Null directions of the chain in closed form, compared with this measurement.
    pub known: Vec<KnownDirection>,
    pub joint_count: usize,
    /// Posterior information of the calibration after the step, priors included, columns in units of the scale.
    pub posterior: PackedFactor,
    /// Standard deviations by the measurements alone, the rig's prior taken out of the posterior information, one per
    /// column in the unit of its dimension; infinite where the prior alone determines a parameter.
    pub flight_sigmas: Vec<f64>,
}

/// Number of unobservable columns by cause.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Deficit {
    /// Redundant in the parameterization, or at its singularity: unobservable at all joint angles (G).
    pub parameterization: usize,
    /// Unobservable at the joint angles of the window: joints that did not move (F).
    pub joints: usize,
    /// Absorbed by free joint angles in every frame (E).
    pub absorbed: usize,
    /// All others: motion of the vehicle and scene (M).
    pub motion: usize,
}

/// A right singular direction of the calibration block.
#[derive(Clone, Debug, PartialEq)]
pub struct CalibrationDirection {
    pub singular_value: f64,
    /// True for a structural zero; false if only uninformed.
    pub structural: bool,
    /// Signed weight of each parameter in the scaled unit direction.
    pub weights: Vec<f64>,
}

impl RankReport {
    pub fn deficit(&self) -> Deficit {
        Deficit {
            parameterization: self.deficit_parameterization,
            joints: self.deficit_joints,
            absorbed: self.deficit_absorbed,
            motion: self.deficit_motion,
        }
    }

    /// Number of null directions with each cause: `6 redundant in the parameterization`; empty without a deficit.
    pub fn deficit_texts(&self) -> Vec<String> {
        let causes = [
            (self.deficit_parameterization, "redundant in the parameterization"),
            (self.deficit_joints, "lost to stationary joints"),
            (self.deficit_absorbed, "absorbed by free joint angles"),
            (self.deficit_motion, "lost to the vehicle's motion"),
        ];
        causes.iter().filter(|(count, _)| *count > 0).map(|(count, cause)| format!("{count} {cause}")).collect()
    }

    /// Summary in one line: `structural rank 18 of 24; 6 redundant in the parameterization; informed rank 15; least observable yaw.d`.
    pub fn verdict(&self, names: &ParameterNames) -> String {
        let mut parts = vec![format!("structural rank {} of {}", self.rank_structural, self.parameters.len())];
        parts.extend(self.deficit_texts());
        parts.push(format!("informed rank {}", self.rank_informed));
        if let Some(parameter) = self.least_observable() {
            let direction = self.least_observable_direction();
            let partner = direction.and_then(|direction| trades_with(&self.parameters, direction));
            let trade = partner.map_or_else(String::new, |it| format!(", which trades with {}", names.name(it)));
            parts.push(format!("least observable {}{trade}", names.name(parameter)));
        }
        parts.join("; ")
    }

    /// Standard deviation of a parameter by the measurements alone, in the unit of its dimension; infinite for a parameter
    /// without a column.
    pub fn flight_sigma(&self, parameter: ParameterId) -> f64 {
        let column = self.parameters.iter().position(|known| *known == parameter);
        column.and_then(|column| self.flight_sigmas.get(column)).copied().unwrap_or(f64::INFINITY)
    }

    pub fn heap_bytes(&self) -> usize {
        let weights = self.directions.iter().map(|direction| of_vec(&direction.weights)).sum::<usize>();
        weights
            + of_vec(&self.parameters)
            + of_vec(&self.fixed_parameters)
            + of_vec(&self.margins)
            + of_vec(&self.singular_values)
            + of_vec(&self.singular_values_with_priors)
            + of_vec(&self.directions)
            + of_vec(&self.known)
            + of_vec(&self.flight_sigmas)
            + self.posterior.heap_bytes()
    }

    /// Number of closed-form null directions that the measurement confirms.
    pub fn known_agreeing(&self) -> usize {
        self.known.iter().filter(|known| known.agrees).count()
    }

    /// Number of closed-form null directions with spurious information.
    pub fn claimed(&self) -> usize {
        self.known.iter().filter(|known| known.is_claimed()).count()
    }

    /// Largest [`KnownDirection::spurious_gain`] of all directions.
    pub fn spurious_gain(&self) -> f64 {
        self.known.iter().map(|known| known.spurious_gain).fold(0.0, f64::max)
    }

    /// Least observable direction that is not a structural zero, else the first null direction.
    pub fn least_observable_direction(&self) -> Option<&CalibrationDirection> {
        let uninformed = self.directions.iter().find(|direction| !direction.structural);
        uninformed.or_else(|| self.directions.first())
    }

    /// Parameter with the largest weight in the least observable direction that is not a structural zero.
    pub fn least_observable(&self) -> Option<ParameterId> {
        let direction = self.directions.iter().find(|direction| !direction.structural)?;
        direction.leading(&self.parameters)
    }
}

impl CalibrationDirection {
    /// Kind for files: `null` or `uninformed`.
    pub fn kind(&self) -> &'static str {
        if self.structural { "null" } else { "uninformed" }
    }

    /// Parameter with the largest weight.
    pub fn leading(&self, parameters: &[ParameterId]) -> Option<ParameterId> {
        let mut leading = None;
        let mut largest = 0.0;
        for (parameter, weight) in parameters.iter().zip(&self.weights) {
            if weight.abs() > largest {
                (leading, largest) = (Some(*parameter), weight.abs());
            }
        }
        leading
    }
}

fn of_vec<T>(vec: &Vec<T>) -> usize {
    allocated_bytes(vec.capacity() * size_of::<T>())
}

/// Parameter with the second largest weight in a direction, if it or the leading one belongs to the shutter, to the
/// intrinsics of a camera or to the intrinsics of the IMU: a joint change of both hardly changes the measurements.
pub(super) fn trades_with(parameters: &[ParameterId], direction: &CalibrationDirection) -> Option<ParameterId> {
    const SMALLEST_RATIO: f64 = 0.3;
    let leading = direction.leading(parameters)?;
    let weight_of = |wanted: ParameterId| {
        parameters.iter().zip(&direction.weights).find(|(it, _)| **it == wanted).map_or(0.0, |(_, weight)| weight.abs())
    };
    let others = parameters.iter().copied().filter(|parameter| *parameter != leading);
    let partner = others.max_by(|a, b| weight_of(*a).total_cmp(&weight_of(*b)))?;
    let of_sensor = |parameter: ParameterId| {
        matches!(parameter.group(), ParameterGroup::Camera | ParameterGroup::Imu)
            || parameter.quantity == Quantity::Readout
    };
    let takes_part = weight_of(partner) >= SMALLEST_RATIO * weight_of(leading);
    (takes_part && (of_sensor(leading) || of_sensor(partner))).then_some(partner)
}
