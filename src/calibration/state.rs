//! Unknowns of the bundle and their columns.

use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

use super::frame_sets::FrameSet;
use crate::estimator::NavigationState;
use crate::estimator::preintegration::Vector15;
use crate::geometry::{RigidTransform, so3};
use crate::gimbal::Chain;
use crate::optimization::{CameraPose, Landmark, Ray, TriangulationOptions, triangulate};

/// Number of columns of pose and velocity, the first in a frame set's block.
const MOTION: usize = 9;
/// Number of columns of a navigation state.
const NAVIGATION: usize = 15;

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Camera {
    /// Fixed to the vehicle.
    Static,
    Gimbal,
}

/// Image in the bundle: a frame set and a camera.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct ViewId(pub(super) usize);

impl ViewId {
    pub(super) fn new(frame_set: usize, camera: Camera) -> Self {
        Self(2 * frame_set + usize::from(camera == Camera::Gimbal))
    }

    pub(super) fn frame_set(self) -> usize {
        self.0 / 2
    }

    pub(super) fn camera(self) -> Camera {
        if self.0.is_multiple_of(2) { Camera::Static } else { Camera::Gimbal }
    }
}

impl From<ViewId> for usize {
    fn from(view: ViewId) -> Self {
        view.0
    }
}

/// Landmark with a fixed anchor in the world: the position of the view that observed it first.
///
/// The anchor does not move with that view, so an observation depends on one camera pose only.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct AnchoredLandmark {
    /// `world_from_anchor`: fixed position, axes of the world.
    pub(super) anchor: CameraPose,
    pub(super) landmark: Landmark,
}

impl AnchoredLandmark {
    /// Landmark at the intersection of rays, anchored at the first one's camera; `None` when the parallax is too small,
    /// or the point lies behind a camera or in the anchor.
    pub(super) fn triangulate(rays: &[Ray], min_parallax_rad: f64) -> Option<Self> {
        let point = triangulate(rays, &TriangulationOptions::of_anchored(min_parallax_rad))?;
        let anchor = CameraPose { rotation: Matrix3::identity(), position_m: rays.first()?.centre };
        Some(Self { anchor, landmark: Landmark::from_point(&(point - anchor.position_m))? })
    }

    /// `x ⊞ δ` of the landmark; the anchor stays fixed.
    pub(super) fn plus(&self, delta: &Vector3<f64>) -> Self {
        Self { anchor: self.anchor, landmark: self.landmark.plus(delta) }
    }
}

#[derive(Clone, Debug)]
pub(super) struct BundleEstimate {
    /// States by frame set.
    pub(super) navigation: Vec<NavigationState>,
    /// Joint angles at the gimbal camera's image, without static offsets, by frame set.
    pub(super) joints_rad: Vec<Vec<f64>>,
    /// `imu_from_camera` of the static camera.
    pub(super) extrinsics: RigidTransform,
    /// Corrections of the rig's time offsets of static and gimbal camera, `t_imu = t_cam + shift`, in seconds.
    pub(super) shifts_s: [f64; 2],
    pub(super) chain: Chain,
    /// Landmarks in the order of the tracks.
    pub(super) landmarks: Vec<AnchoredLandmark>,
}

/// Column layout: one block per frame set, `[φ p v | joints | b_g b_a]`, and the border common to all frame sets,
/// `[extrinsics 6 | static shift | chain | gimbal shift]`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Columns {
    pub(super) frame_sets: usize,
    pub(super) joints: usize,
    pub(super) chain: usize,
}

impl Columns {
    /// Number of columns of a pose, the first in a frame set's block.
    pub(super) const POSE: usize = 6;
    pub(super) const EXTRINSICS: usize = 0;
    pub(super) const STATIC_SHIFT: usize = 6;
    pub(super) const CHAIN: usize = 7;

    pub(super) fn gimbal_shift(&self) -> usize {
        Self::CHAIN + self.chain
    }

    pub(super) fn borders(&self) -> usize {
        Self::CHAIN + self.chain + 1
    }

    pub(super) fn block(&self) -> usize {
        NAVIGATION + self.joints
    }

    pub(super) fn band(&self) -> usize {
        self.frame_sets * self.block()
    }

    /// Number of columns that affect a view directly: pose, velocity and joints of its frame set.
    pub(super) fn own(&self) -> usize {
        MOTION + self.joints
    }

    /// Column within the block of an entry of a navigation state.
    pub(super) fn navigation(&self, entry: usize) -> usize {
        if entry < MOTION { entry } else { entry + self.joints }
    }

    /// Column of a joint within the block.
    pub(super) fn joint(joint: usize) -> usize {
        MOTION + joint
    }
}

impl BundleEstimate {
    /// Estimate after a step of band, border and landmarks.
    pub(super) fn moved(
        &self,
        columns: &Columns,
        band: &[f64],
        border: &DVector<f64>,
        landmarks: &[Vector3<f64>],
    ) -> Self {
        let mut moved = self.clone();
        for (frame_set, block) in band.chunks_exact(columns.block()).enumerate() {
            let step = Vector15::from_fn(|entry, _| block[columns.navigation(entry)]);
            moved.navigation[frame_set] = self.navigation[frame_set].plus(&step);
            for (joint, angle) in moved.joints_rad[frame_set].iter_mut().enumerate() {
                *angle += block[Columns::joint(joint)];
            }
        }
        moved.extrinsics = self.extrinsics.plus(&border.fixed_rows::<6>(Columns::EXTRINSICS).into_owned());
        moved.shifts_s[0] += border[Columns::STATIC_SHIFT];
        moved.chain = self.chain.plus_slice(&border.as_slice()[Columns::CHAIN..columns.gimbal_shift()]);
        moved.shifts_s[1] += border[columns.gimbal_shift()];
        for (landmark, step) in moved.landmarks.iter_mut().zip(landmarks) {
            *landmark = landmark.plus(step);
        }
        moved
    }

    /// State of the vehicle at a view and its angular velocity there; the rotation over the time offset is not
    /// applied.
    fn vehicle_at(
        &self,
        view: ViewId,
        frame_sets: &[FrameSet],
        gravity: &Vector3<f64>,
    ) -> (NavigationState, Vector3<f64>) {
        let frame_set = &frame_sets[view.frame_set()];
        let here = NavigationState { bias: frame_set.bias, ..self.navigation[view.frame_set()] };
        match (view.camera(), &frame_set.gimbal) {
            (Camera::Gimbal, Some(gimbal)) => {
                (gimbal.image_delay.predict(&here, gravity), gimbal.gyroscope_rad_per_s - here.bias.gyroscope_rad_per_s)
            }
            _ => (here, frame_set.gyroscope_rad_per_s - here.bias.gyroscope_rad_per_s),
        }
    }

    /// `world_from_imu` at a view.
    pub(super) fn world_from_imu(
        &self,
        view: ViewId,
        frame_sets: &[FrameSet],
        gravity: &Vector3<f64>,
    ) -> RigidTransform {
        let (state, rate) = self.vehicle_at(view, frame_sets, gravity);
        let shift_s = self.shifts_s[usize::from(view.camera() == Camera::Gimbal)];
        RigidTransform::new(
            state.world_from_imu.rotation * so3::exp(&(rate * shift_s)),
            state.world_from_imu.translation_m + state.velocity_m_per_s * shift_s,
        )
    }

    fn imu_from_camera(&self, view: ViewId) -> RigidTransform {
        match view.camera() {
            Camera::Static => self.extrinsics,
            Camera::Gimbal => self.chain.imu_from_camera(&self.joints_rad[view.frame_set()]),
        }
    }

    /// `world_from_camera` of a view.
    pub(super) fn view(&self, view: ViewId, frame_sets: &[FrameSet], gravity: &Vector3<f64>) -> CameraPose {
        (self.world_from_imu(view, frame_sets, gravity) * self.imu_from_camera(view)).into()
    }

    /// Jacobian of a view's pose `T_WC = [R', p']·T_IC` by the unknowns, for the image's delay `d` in the frame set with the
    /// preintegrated motion `ΔR, Δp, Δv` and the time offset `s`:
    /// `R' = R·ΔR·Exp(ω s)`, `p' = p + v (d + s) + R (Δp + Δv s) +` gravity.
    ///
    /// ```text
    /// by φ:  [R_CI R'ᵀ R; −R' [t_IC]× R'ᵀ R − R [Δp + Δv s]×]     by p:  [0; I]     by v:  [0; (d + s) I]
    /// by s:  [R_CI ω; v' − R' [t_IC]× ω]                          by [φ; δt] of T_IC:  [I, 0; 0, R']
    /// ```
    pub(super) fn view_map(
        &self,
        view: ViewId,
        columns: &Columns,
        frame_sets: &[FrameSet],
        gravity: &Vector3<f64>,
    ) -> ViewMap {
        let (state, rate) = self.vehicle_at(view, frame_sets, gravity);
        let frame_set = view.frame_set();
        let here = &self.navigation[frame_set];
        let gimbal = view.camera() == Camera::Gimbal;
        let shift_s = self.shifts_s[usize::from(gimbal)];
        let node: Matrix3<f64> = here.world_from_imu.rotation_matrix();
        let image_delay = frame_sets[frame_set].gimbal.as_ref().filter(|_| gimbal).map(|gimbal| &gimbal.image_delay);
        let world_from_imu: Matrix3<f64> =
            (state.world_from_imu.rotation * so3::exp(&(rate * shift_s))).to_rotation_matrix().into_inner();
        // From the IMU frame of the frame set to the camera frame.
        let imu_from_node = world_from_imu.tr_mul(&node);
        let (lag_s, carried) = image_delay.map_or_else(
            || (0.0, Vector3::zeros()),
            |image_delay| {
                let motion = image_delay.corrected(&frame_sets[frame_set].bias);
                (image_delay.duration_s(), motion.position_m + motion.velocity_m_per_s * shift_s)
            },
        );
        let extrinsics = self.imu_from_camera(view);
        let camera_from_imu: Matrix3<f64> = extrinsics.rotation_matrix().transpose();
        let camera_from_node = camera_from_imu * imu_from_node;
        let lever = world_from_imu * so3::hat(&extrinsics.translation_m);

        let mut own = DMatrix::zeros(6, columns.own());
        own.fixed_view_mut::<3, 3>(0, 0).copy_from(&camera_from_node);
        own.fixed_view_mut::<3, 3>(3, 0).copy_from(&-(lever * imu_from_node + node * so3::hat(&carried)));
        own.fixed_view_mut::<3, 3>(3, 3).fill_with_identity();
        own.fixed_view_mut::<3, 3>(3, 6).fill_diagonal(lag_s + shift_s);
        let mut shared = DMatrix::zeros(6, columns.borders());
        let shift = if gimbal { columns.gimbal_shift() } else { Columns::STATIC_SHIFT };
        shared.fixed_view_mut::<3, 1>(0, shift).copy_from(&(camera_from_imu * rate));
        shared.fixed_view_mut::<3, 1>(3, shift).copy_from(&(state.velocity_m_per_s - lever * rate));
        if gimbal {
            let chain = self.chain.linearize(&self.joints_rad[frame_set]);
            let carry = |part: &nalgebra::Matrix6xX<f64>, mut place: nalgebra::DMatrixViewMut<'_, f64>| {
                place.copy_from(part);
                let outer = world_from_imu * part.fixed_rows::<3>(3);
                place.fixed_rows_mut::<3>(3).copy_from(&outer);
            };
            carry(&chain.by_joints, own.columns_mut(MOTION, columns.joints));
            carry(&chain.by_parameters, shared.columns_mut(Columns::CHAIN, columns.chain));
        } else {
            shared.fixed_view_mut::<3, 3>(0, Columns::EXTRINSICS).fill_with_identity();
            shared.fixed_view_mut::<3, 3>(3, Columns::EXTRINSICS + 3).copy_from(&world_from_imu);
        }
        ViewMap { own, shared }
    }
}

/// Jacobian of `[φ; δt]` of one view's `world_from_camera` with respect to the unknowns.
#[derive(Clone, Debug)]
pub(super) struct ViewMap {
    /// Derivative by pose, velocity and joints of the view's frame set (6 × own).
    pub(super) own: DMatrix<f64>,
    /// Derivative by the border (6 × borders).
    pub(super) shared: DMatrix<f64>,
}
