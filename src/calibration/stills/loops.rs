//! Least-squares problem of all pose loops: chain, further rigid cameras, joint angles, errors of the map.
//!
//! Cost: `Σ |r + D·u|² + Σ w (q − reading − F·β)²/σ_q² + Σ u²/σ_u²`, over sets and stations. `u` are the errors of the map,
//! `β` the coefficients of tested encoder errors, `w` the weight of a set's readings.

use nalgebra::{DVector, Vector3, Vector6};

use super::noise::{FREE_ANGLE_SIGMA_RAD, StillsNoise};
use super::observed::ObservedSet;
use crate::geometry::RigidTransform;
use crate::gimbal::Chain;
use crate::optimization::damped::LeastSquares;
use crate::optimization::{TwoLevelEquations, TwoLevelPosterior, TwoLevelStep};

/// Largest σ of a column of the chain or of a further camera, in units of its scale (10° and 3 cm).
const WEAKEST: f64 = 100.0;
/// Largest σ of an encoder coefficient.
const WEAKEST_EFFECT: f64 = 10.0;

/// Systematic error of one encoder: a function of the set, known up to a coefficient.
#[derive(Clone, Debug)]
pub(super) struct EncoderTerm {
    pub(super) joint: usize,
    /// Value of the function at each set, in rad per unit of the coefficient.
    pub(super) values: Vec<f64>,
}

#[derive(Clone, Debug)]
pub(super) struct StillsState {
    /// Chain as a product of exponentials, which has no singularity.
    pub(super) chain: Chain,
    /// `camera_from_first` of the rigid cameras after the first one.
    pub(super) further: Vec<RigidTransform>,
    /// One coefficient per [`EncoderTerm`].
    pub(super) effects: Vec<f64>,
    /// By set, in rad.
    pub(super) joints_rad: Vec<Vec<f64>>,
    /// Position error of the gimbal camera by the map, by set.
    pub(super) gimbal_map_m: Vec<Vector3<f64>>,
    /// `[φ; δt]` of each rigid camera by the map, by station and camera.
    pub(super) rigid_map: Vec<Vec<Vector6<f64>>>,
}

impl StillsState {
    pub(super) fn at_readings(chain: Chain, further: Vec<RigidTransform>, loops: &StillsLoops<'_>) -> Self {
        Self {
            chain,
            effects: vec![0.0; loops.terms.len()],
            joints_rad: loops.sets.iter().map(|set| set.readings_rad.clone()).collect(),
            gimbal_map_m: vec![Vector3::zeros(); loops.sets.len()],
            rigid_map: vec![vec![Vector6::zeros(); further.len() + 1]; loops.stations.len()],
            further,
        }
    }
}

/// The loops of some sets, with their noise.
#[derive(Clone, Debug)]
pub(super) struct StillsLoops<'a> {
    pub(super) sets: Vec<&'a ObservedSet>,
    /// Places in `sets` of the sets of each station.
    pub(super) stations: Vec<Vec<usize>>,
    pub(super) noise: StillsNoise,
    /// Weight of the readings of each set, 0 to 1.
    pub(super) reading_weights: Vec<f64>,
    pub(super) terms: Vec<EncoderTerm>,
}

impl<'a> StillsLoops<'a> {
    pub(super) fn new(sets: Vec<&'a ObservedSet>, noise: StillsNoise) -> Self {
        let mut names: Vec<u64> = Vec::new();
        let mut stations: Vec<Vec<usize>> = Vec::new();
        for (place, set) in sets.iter().enumerate() {
            if let Some(index) = names.iter().position(|name| *name == set.station) {
                stations[index].push(place);
            } else {
                names.push(set.station);
                stations.push(vec![place]);
            }
        }
        Self { reading_weights: vec![1.0; sets.len()], sets, stations, noise, terms: Vec::new() }
    }

    /// Sum of the encoder terms of a joint at a set, in rad.
    fn encoder_error_rad(&self, state: &StillsState, place: usize, joint: usize) -> f64 {
        let terms = self.terms.iter().zip(&state.effects).filter(|(term, _)| term.joint == joint);
        terms.map(|(term, coefficient)| term.values[place] * coefficient).sum()
    }

    /// Angle minus reading and encoder terms, in rad.
    pub(super) fn correction_rad(&self, state: &StillsState, place: usize, joint: usize) -> f64 {
        state.joints_rad[place][joint]
            - self.sets[place].readings_rad[joint]
            - self.encoder_error_rad(state, place, joint)
    }

    /// Weight of a reading in the cost, in 1/rad².
    fn reading_information(&self, place: usize, joint: usize) -> f64 {
        self.reading_weights[place] / self.noise.encoder_rad[joint].powi(2) + FREE_ANGLE_SIGMA_RAD.powi(-2)
    }

    /// Standard deviations of `[φ; δt]` of a rigid camera by the map.
    pub(super) fn rigid_map_sigma(&self, coordinate: usize) -> f64 {
        if coordinate < 3 { self.noise.station_rotation_rad } else { self.noise.station_position_m }
    }

    fn residual(&self, state: &StillsState, station: usize, place: usize) -> DVector<f64> {
        let set = self.sets[place];
        self.with_map(state, station, place, set.residual(&state.chain, &state.further, &state.joints_rad[place]))
    }

    /// Residual `r + D·u` with the deviations of the map.
    fn with_map(&self, state: &StillsState, station: usize, place: usize, mut residual: DVector<f64>) -> DVector<f64> {
        let set = self.sets[place];
        residual += &set.by_gimbal_map * state.gimbal_map_m[place];
        for ((camera, _), by_map) in set.rigid.iter().zip(&set.by_rigid_map) {
            residual += by_map * state.rigid_map[station][*camera];
        }
        residual
    }

    /// Sizes of the common unknowns: chain, further cameras, encoder terms.
    fn common_sizes(&self, state: &StillsState) -> [usize; 3] {
        [state.chain.dof(), 6 * state.further.len(), self.terms.len()]
    }

    fn own_size(&self, state: &StillsState, station: usize) -> usize {
        self.stations[station].len() * (state.chain.joint_count() + 3) + 6 * (state.further.len() + 1)
    }

    /// Largest σ of the common unknowns.
    fn weakest(&self, state: &StillsState) -> DVector<f64> {
        let chain = state.chain.parameters().into_iter().map(|parameter| WEAKEST * parameter.scale());
        let six = crate::gimbal::Quantity::TRANSFORM.map(|quantity| WEAKEST * quantity.dimension().scale());
        let further = (0..state.further.len()).flat_map(|_| six);
        let effects = self.terms.iter().map(|_| WEAKEST_EFFECT);
        let values: Vec<f64> = chain.chain(further).chain(effects).collect();
        DVector::from_vec(values)
    }

    pub(super) fn posterior(&self, state: &StillsState) -> Option<TwoLevelPosterior> {
        self.linearize(state).posterior(&self.weakest(state))
    }

    /// Adds rows and priors of one set, the `index`-th of its station.
    fn add_set(&self, equations: &mut TwoLevelEquations, state: &StillsState, station: usize, index: usize) {
        let place = self.stations[station][index];
        let set = self.sets[place];
        let joints = state.chain.joint_count();
        let [chain, further, _] = self.common_sizes(state);
        let rows = set.rows(&state.chain, &state.further, &state.joints_rad[place]);
        let residual = self.with_map(state, station, place, rows.residual.clone());
        let first = index * (joints + 3);
        let rigid = self.own_size(state, station) - 6 * (state.further.len() + 1);
        let mut own = vec![(first, &rows.by_joints), (first + joints, &set.by_gimbal_map)];
        own.extend(set.rigid.iter().zip(&set.by_rigid_map).map(|((camera, _), by_map)| (rigid + 6 * camera, by_map)));
        equations.add(station, &residual, &own, &[(0, &rows.by_chain), (chain, &rows.by_further)], 1.0);
        let group = &mut equations.groups[station];
        for coordinate in 0..3 {
            let error_m = state.gimbal_map_m[place][coordinate];
            group.own.add_diagonal(first + joints + coordinate, error_m, self.noise.set_position_m.powi(-2));
        }
        for joint in 0..joints {
            let row = first + joint;
            let information = self.reading_information(place, joint);
            let correction = self.correction_rad(state, place, joint);
            group.own.add_diagonal(row, correction, information);
            let terms = || {
                let terms = self.terms.iter().enumerate().filter(|(_, term)| term.joint == joint);
                terms.map(|(index, term)| (chain + further + index, term.values[place]))
            };
            for (column, value) in terms() {
                group.coupling[(row, column)] -= information * value;
                equations.common.gradient[column] -= information * value * correction;
                for (other, other_value) in terms() {
                    equations.common.hessian[(column, other)] += information * value * other_value;
                }
            }
        }
    }
}

impl LeastSquares for StillsLoops<'_> {
    type Estimate = StillsState;
    type Equations = TwoLevelEquations;

    fn cost(&self, state: &StillsState) -> f64 {
        let mut cost = 0.0;
        for (station, places) in self.stations.iter().enumerate() {
            for &place in places {
                cost += self.residual(state, station, place).norm_squared();
                cost += state.gimbal_map_m[place].norm_squared() / self.noise.set_position_m.powi(2);
                for joint in 0..state.chain.joint_count() {
                    let correction = self.correction_rad(state, place, joint);
                    cost += self.reading_information(place, joint) * correction * correction;
                }
            }
            for errors in &state.rigid_map[station] {
                let whitened = errors.iter().enumerate().map(|(index, error)| error / self.rigid_map_sigma(index));
                cost += whitened.map(|error| error * error).sum::<f64>();
            }
        }
        cost
    }

    fn linearize(&self, state: &StillsState) -> TwoLevelEquations {
        let common = self.common_sizes(state).iter().sum();
        let sizes: Vec<usize> = (0..self.stations.len()).map(|station| self.own_size(state, station)).collect();
        let mut equations = TwoLevelEquations::zeros(&sizes, common);
        for station in 0..self.stations.len() {
            for index in 0..self.stations[station].len() {
                self.add_set(&mut equations, state, station, index);
            }
            let first = sizes[station] - 6 * (state.further.len() + 1);
            for (camera, errors) in state.rigid_map[station].iter().enumerate() {
                for (coordinate, error) in errors.iter().enumerate() {
                    let row = first + 6 * camera + coordinate;
                    let information = self.rigid_map_sigma(coordinate).powi(-2);
                    equations.groups[station].own.add_diagonal(row, *error, information);
                }
            }
        }
        equations
    }

    fn plus(&self, state: &StillsState, step: &TwoLevelStep) -> StillsState {
        let mut moved = state.clone();
        let [chain, further, _] = self.common_sizes(state);
        moved.chain = state.chain.plus_slice(&step.common.as_slice()[..chain]);
        for (index, transform) in moved.further.iter_mut().enumerate() {
            *transform = transform.plus(&step.common.fixed_rows::<6>(chain + 6 * index).into_owned());
        }
        for (effect, delta) in moved.effects.iter_mut().zip(step.common.iter().skip(chain + further)) {
            *effect += delta;
        }
        let joints = state.chain.joint_count();
        for (station, delta) in step.groups.iter().enumerate() {
            for (index, &place) in self.stations[station].iter().enumerate() {
                let first = index * (joints + 3);
                for joint in 0..joints {
                    moved.joints_rad[place][joint] += delta[first + joint];
                }
                moved.gimbal_map_m[place] += delta.fixed_rows::<3>(first + joints);
            }
            let rigid = delta.len() - 6 * (state.further.len() + 1);
            for (camera, errors) in moved.rigid_map[station].iter_mut().enumerate() {
                *errors += delta.fixed_rows::<6>(rigid + 6 * camera);
            }
        }
        moved
    }
}
