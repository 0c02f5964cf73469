use nalgebra::{DVector, Vector6};

use crate::geometry::{RigidTransform, so3};

use super::conversion;
use super::{ClassicalChain, DhLink, Parameterization};

const RADIANS: &str = "rad";
const METRES: &str = "m";
/// Names and units of a rigid transform's six columns.
const BLOCK_COLUMNS: [(&str, &str); 6] =
    [("rx", RADIANS), ("ry", RADIANS), ("rz", RADIANS), ("tx", METRES), ("ty", METRES), ("tz", METRES)];
/// Names and units of a link's four columns.
const LINK_COLUMNS: [(&str, &str); 4] = [("theta", RADIANS), ("d", METRES), ("a", METRES), ("alpha", RADIANS)];

/// The numbers of a chain of at least one joint in a minimal form.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct MinimalChain {
    /// `rx ry`, or `ry rx` in the yx order, in radians.
    pub(super) base_angles_rad: [f64; 2],
    /// `tx ty` after those turns, in metres.
    pub(super) base_shift_m: [f64; 2],
    /// All links; the last one's `alpha` belongs to the end block.
    pub(super) links: Vec<DhLink>,
    /// Turn about y in the end block.
    pub(super) beta_rad: f64,
    /// Shift along y in the end block.
    pub(super) y_m: f64,
}

/// The numbers of a chain, one variant for each kind of columns.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Form {
    Classical(ClassicalChain),
    Minimal(MinimalChain),
    /// `X0 … XN`.
    Poe(Vec<RigidTransform>),
    /// No joints: every form but the classical one is a single rigid transform.
    Rigid(RigidTransform),
}

/// A gimbal chain in one parameterization: its static calibration as named columns.
///
/// Updates follow the rule of [`crate::geometry`]: rigid-transform blocks take `[φ; δt]` on the right, scalars add, and
/// the inner blocks of `poe` take `(wx, wy, vx, vy)`, `R ← R·Exp([wx, wy, 0])`, `t ← t + R·[vx, vy, 0]`.
#[derive(Clone, Debug, PartialEq)]
pub struct Chain {
    pub(super) parameterization: Parameterization,
    /// Whether the joint offsets are left out of the columns.
    pub(super) offsets_hidden: bool,
    pub(super) form: Form,
}

impl Chain {
    /// The same mechanism in another form; exact for every chain, also at a chart's lock.
    pub fn from_classical(classical: &ClassicalChain, parameterization: Parameterization) -> Self {
        let form = if parameterization == Parameterization::Classical {
            Form::Classical(classical.clone())
        } else if classical.links.is_empty() {
            Form::Rigid(classical.imu_from_base * classical.effector_from_camera)
        } else if parameterization == Parameterization::Poe {
            Form::Poe(conversion::poe_blocks(classical))
        } else {
            Form::Minimal(conversion::minimal(classical, parameterization))
        };
        Self { parameterization, offsets_hidden: false, form }
    }

    /// The chain in the classical form, with the same forward kinematics.
    pub fn to_classical(&self) -> ClassicalChain {
        match &self.form {
            Form::Classical(chain) => chain.clone(),
            Form::Minimal(chain) => conversion::classical_of_minimal(chain, self.parameterization),
            Form::Poe(blocks) => conversion::classical_of_poe(blocks),
            Form::Rigid(imu_from_camera) => {
                ClassicalChain { imu_from_base: *imu_from_camera, ..ClassicalChain::default() }
            }
        }
    }

    /// The same mechanism with the same choice about offsets, in another form.
    pub fn in_parameterization(&self, parameterization: Parameterization) -> Self {
        if parameterization == self.parameterization {
            return self.clone();
        }
        let chain = Self::from_classical(&self.to_classical(), parameterization);
        if self.offsets_hidden { chain.without_joint_offsets() } else { chain }
    }

    /// The chain with its joint offsets held fixed: their columns disappear from names, values, derivatives and updates.
    ///
    /// Without encoders and without a prior on the angles, free joint angles absorb the offsets, so that only one of the
    /// two may be estimated. The columns of `poe` are not offsets; it keeps them all.
    #[must_use]
    pub fn without_joint_offsets(mut self) -> Self {
        self.offsets_hidden = true;
        self
    }

    /// Whether the joint offsets are left out of the columns.
    pub fn hides_joint_offsets(&self) -> bool {
        self.offsets_hidden
    }

    /// The form it is written in.
    pub fn parameterization(&self) -> Parameterization {
        self.parameterization
    }

    /// Number of joints.
    pub fn joint_count(&self) -> usize {
        match &self.form {
            Form::Classical(chain) => chain.links.len(),
            Form::Minimal(chain) => chain.links.len(),
            Form::Poe(blocks) => blocks.len() - 1,
            Form::Rigid(_) => 0,
        }
    }

    /// Number of columns.
    pub fn dof(&self) -> usize {
        let joints = self.joint_count();
        match self.form {
            Form::Classical(_) => 12 + 4 * joints - self.hidden_count(),
            _ => 6 + 4 * joints - self.hidden_count(),
        }
    }

    fn hidden_count(&self) -> usize {
        if self.offsets_hidden && matches!(self.form, Form::Classical(_) | Form::Minimal(_)) {
            self.joint_count()
        } else {
            0
        }
    }

    /// Columns of the chain with its offsets that the chain without them keeps.
    pub(super) fn kept_columns(&self) -> Vec<usize> {
        let columns = self.all_columns();
        (0..columns.len()).filter(|&index| !self.hides(&columns[index].0)).collect()
    }

    fn hides(&self, name: &str) -> bool {
        self.offsets_hidden && name.split_once('.').is_some_and(|(_, name)| name == "theta")
    }

    /// Names and units of all columns, hidden ones included.
    fn all_columns(&self) -> Vec<(String, &'static str)> {
        let block = |prefix: &str| BLOCK_COLUMNS.map(|(name, unit)| (format!("{prefix}.{name}"), unit));
        let link = |index: usize| LINK_COLUMNS.map(|(name, unit)| (format!("L{}.{name}", index + 1), unit));
        match &self.form {
            Form::Classical(chain) => {
                let links = (0..chain.links.len()).flat_map(link);
                block("IB").into_iter().chain(links).chain(block("EC")).collect()
            }
            Form::Minimal(chain) => {
                let base = if self.parameterization.base_yx() { ["ry", "rx"] } else { ["rx", "ry"] };
                let mut columns: Vec<_> = base.map(|name| (format!("I.{name}"), RADIANS)).into();
                columns.extend(["tx", "ty"].map(|name| (format!("I.{name}"), METRES)));
                columns.extend((0..chain.links.len()).flat_map(link));
                let beta = (format!("L{}.beta", chain.links.len()), RADIANS);
                let y = (format!("L{}.y", chain.links.len()), METRES);
                if self.parameterization.end_swapped() {
                    let alpha = columns.pop();
                    columns.extend([y, beta]);
                    columns.extend(alpha);
                } else {
                    columns.extend([beta, y]);
                }
                columns
            }
            Form::Poe(blocks) => {
                let last = blocks.len() - 1;
                let local = [("wx", RADIANS), ("wy", RADIANS), ("vx", METRES), ("vy", METRES)];
                let inner = (0..last).flat_map(|index| local.map(|(name, unit)| (format!("X{index}.{name}"), unit)));
                inner.chain(block(&format!("X{last}"))).collect()
            }
            Form::Rigid(_) => block("IC").into(),
        }
    }

    /// Names in column order: `IB.rx`, `L1.theta`, …, as in the golden vectors.
    pub fn parameter_names(&self) -> Vec<String> {
        self.all_columns().into_iter().map(|(name, _)| name).filter(|name| !self.hides(name)).collect()
    }

    /// Unit of each column, `rad` or `m`.
    pub fn parameter_units(&self) -> Vec<&'static str> {
        self.all_columns().into_iter().filter(|(name, _)| !self.hides(name)).map(|(_, unit)| unit).collect()
    }

    /// Value of each column: scalars as they are, rigid transforms as rotation vector and translation, inner blocks of
    /// `poe` as the x and y parts of the rotation vector and of the translation in the block's own axes.
    pub fn values(&self) -> DVector<f64> {
        let mut values = Vec::with_capacity(self.dof());
        let block = |values: &mut Vec<f64>, transform: &RigidTransform| {
            values.extend(so3::log(&transform.rotation).iter());
            values.extend(transform.translation_m.iter());
        };
        match &self.form {
            Form::Classical(chain) => {
                block(&mut values, &chain.imu_from_base);
                for link in &chain.links {
                    self.push_link(&mut values, link);
                }
                block(&mut values, &chain.effector_from_camera);
            }
            Form::Minimal(chain) => {
                values.extend(chain.base_angles_rad);
                values.extend(chain.base_shift_m);
                for link in &chain.links {
                    self.push_link(&mut values, link);
                }
                if self.parameterization.end_swapped() {
                    let alpha = values.pop();
                    values.extend([chain.y_m, chain.beta_rad]);
                    values.extend(alpha);
                } else {
                    values.extend([chain.beta_rad, chain.y_m]);
                }
            }
            Form::Poe(blocks) => {
                let (last, inner) = blocks.split_last().expect("a product of exponentials has a last block");
                for transform in inner {
                    let turn = so3::log(&transform.rotation);
                    let shift = transform.rotation.inverse() * transform.translation_m;
                    values.extend([turn.x, turn.y, shift.x, shift.y]);
                }
                block(&mut values, last);
            }
            Form::Rigid(transform) => block(&mut values, transform),
        }
        DVector::from_vec(values)
    }

    fn push_link(&self, values: &mut Vec<f64>, link: &DhLink) {
        if !self.offsets_hidden {
            values.push(link.theta_offset_rad);
        }
        values.extend([link.d_m, link.a_m, link.alpha_rad]);
    }
}

/// The six numbers of a block of columns, from where a slice of columns stands.
pub(super) fn take_block(delta: &mut impl Iterator<Item = f64>) -> Vector6<f64> {
    Vector6::from_fn(|_, _| delta.next().unwrap_or(0.0))
}
