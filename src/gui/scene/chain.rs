//! The gimbal's chain at one frame: its frames as axes, its links as rods, and the ground-truth chain translucent.

use egui::Color32;
use nalgebra::{UnitQuaternion, Vector3};

use super::camera::{length, screen_axes};
use super::model::SceneModel;
use crate::geometry::{RigidTransform, so3};
use crate::gimbal::ClassicalChain;
use crate::gui::theme::{Theme, mix};

/// Ratio of the length of an axis to the extent of the chain.
const AXIS_LENGTH_RATIO: f64 = 0.13;

/// A chain at given joint angles, in the IMU frame.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct ChainPose {
    /// Names of the frames: `I`, `B`, `J2`, …, `E`, `C`.
    pub(super) names: Vec<String>,
    /// Poses `imu_from_frame` of the frames.
    pub(super) imu_from_frame: Vec<RigidTransform>,
    /// Per link the corner between its translation along the joint's axis and its translation along the link, in metres
    /// in the IMU frame.
    corners_m: Vec<Vector3<f64>>,
}

impl ChainPose {
    /// Forward kinematics link by link (Eq. 2); missing angles count as zero.
    pub(super) fn at(chain: &ClassicalChain, joint_angles_rad: &[f64]) -> Self {
        let mut names = vec!["I".to_owned()];
        let mut imu_from_frame = vec![RigidTransform::identity()];
        let mut corners_m = Vec::new();
        let mut pose = chain.imu_from_base;
        if !chain.links.is_empty() {
            names.push("B".to_owned());
            imu_from_frame.push(pose);
        }
        for (index, link) in chain.links.iter().enumerate() {
            let angle_rad = joint_angles_rad.get(index).copied().unwrap_or(0.0) + link.theta_offset_rad;
            let rotation = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), angle_rad);
            let twist = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), link.alpha_rad);
            let raised = pose * RigidTransform::new(rotation, Vector3::new(0.0, 0.0, link.d_m));
            corners_m.push(raised.translation_m);
            pose = raised * RigidTransform::new(twist, Vector3::new(link.a_m, 0.0, 0.0));
            let is_last = index + 1 == chain.links.len();
            names.push(if is_last { "E".to_owned() } else { format!("J{}", index + 2) });
            imu_from_frame.push(pose);
        }
        names.push("C".to_owned());
        imu_from_frame.push(pose * chain.effector_from_camera);
        Self { names, imu_from_frame, corners_m }
    }

    /// Direction from which the frames have the largest distances on the screen. It is the same for all joint angles,
    /// so that the view does not rotate with the joints.
    pub(super) fn best_direction(chain: &ClassicalChain) -> Vector3<f64> {
        const ROUND: [[f64; 2]; 16] = {
            const QUARTER: [[f64; 2]; 4] = [[5.0, 0.0], [4.6, 1.9], [3.5, 3.5], [1.9, 4.6]];
            let mut all = [[0.0; 2]; 16];
            let mut index = 0;
            while index < 4 {
                let [x, y] = QUARTER[index];
                (all[index], all[index + 4]) = ([x, y], [-y, x]);
                (all[index + 8], all[index + 12]) = ([-x, -y], [y, -x]);
                index += 1;
            }
            all
        };
        let origins: Vec<Vector3<f64>> = Self::at(chain, &[]).origins_m().collect();
        let mut best = (f64::NEG_INFINITY, Vector3::new(0.55, -0.75, 0.45));
        for height in [2.0, 3.5] {
            for [x, y] in ROUND {
                let towards = Vector3::new(x, y, height).normalize();
                let [right, up] = screen_axes(&towards);
                let seen = |offset: Vector3<f64>| length(right.dot(&offset), up.dot(&offset));
                let mut nearest_m = f64::INFINITY;
                for (index, origin) in origins.iter().enumerate() {
                    for other in &origins[..index] {
                        nearest_m = nearest_m.min(seen(origin - other));
                    }
                }
                if nearest_m > best.0 {
                    best = (nearest_m, towards);
                }
            }
        }
        best.1
    }

    pub(super) fn imu_from_camera(&self) -> RigidTransform {
        self.imu_from_frame.last().copied().unwrap_or_default()
    }

    fn origins_m(&self) -> impl Iterator<Item = Vector3<f64>> {
        self.imu_from_frame.iter().map(|pose| pose.translation_m)
    }

    /// Largest distance of a frame from the IMU in metres.
    fn extent_m(&self) -> f64 {
        self.origins_m().map(|origin| origin.norm()).fold(0.0, f64::max)
    }

    fn axis_length_m(&self) -> f64 {
        (self.extent_m() * AXIS_LENGTH_RATIO).max(1e-4)
    }

    fn framing_points_m(&self) -> Vec<Vector3<f64>> {
        let length_m = 0.7 * self.axis_length_m();
        let tips = [Vector3::x(), Vector3::y(), Vector3::z()];
        let poses = self.imu_from_frame.iter();
        let ends = poses.flat_map(|pose| tips.map(|tip| pose.transform(&(tip * length_m))));
        ends.chain(self.skeleton_m()).collect()
    }
}

/// The chain at one frame and its reference.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct ChainModel {
    pub(super) estimate: ChainPose,
    /// The ground-truth chain at the same joint angles, or the estimate when `estimate` is moved away from it.
    pub(super) ground_truth: Option<ChainPose>,
    /// True if `estimate` is moved along a direction; `ground_truth` is then the chain before the move.
    pub(super) moved: bool,
    pub(super) rows: Vec<LinkRow>,
    /// Distance in metres and angle in radians between the camera poses in the IMU frame of `estimate` and
    /// `ground_truth`.
    pub(super) camera_error: Option<(f64, f64)>,
}

#[derive(Clone, Debug, PartialEq)]
pub(super) struct LinkRow {
    pub(super) joint: String,
    /// The joint angle without the static offset.
    pub(super) angle_rad: f64,
    pub(super) theta_offset_rad: f64,
    pub(super) d_m: f64,
    pub(super) a_m: f64,
    pub(super) alpha_rad: f64,
}

impl ChainModel {
    /// True if the camera is moved by joints.
    pub(super) fn has_joints(&self) -> bool {
        !self.rows.is_empty()
    }

    /// The chain at given joint angles; missing angles count as zero.
    pub(super) fn at(
        angles_rad: &[f64],
        chain: &ClassicalChain,
        true_chain: Option<&ClassicalChain>,
        joint_names: &[String],
    ) -> Self {
        let estimate = ChainPose::at(chain, angles_rad);
        let ground_truth = true_chain.map(|chain| ChainPose::at(chain, angles_rad));
        let camera_error = ground_truth.as_ref().map(|ground_truth| {
            let difference = ground_truth.imu_from_camera().inverse() * estimate.imu_from_camera();
            (difference.translation_m.norm(), so3::log(&difference.rotation).norm())
        });
        let rows = chain
            .links
            .iter()
            .enumerate()
            .map(|(index, link)| LinkRow {
                joint: joint_names.get(index).cloned().unwrap_or_else(|| format!("joint {}", index + 1)),
                angle_rad: angles_rad.get(index).copied().unwrap_or(f64::NAN),
                theta_offset_rad: link.theta_offset_rad,
                d_m: link.d_m,
                a_m: link.a_m,
                alpha_rad: link.alpha_rad,
            })
            .collect();
        Self { estimate, ground_truth, moved: false, rows, camera_error }
    }

    fn axis_length_m(&self) -> f64 {
        let sized = self.ground_truth.as_ref().filter(|_| self.moved).unwrap_or(&self.estimate);
        sized.axis_length_m()
    }

    /// Points that a view of the chain must contain; they do not depend on a move along a direction.
    pub(super) fn framing_points_m(&self) -> Vec<Vector3<f64>> {
        /// Ratio of the framed extent to the extent of the chain; leaves space for a moved chain.
        const ROOM: f64 = 1.35;
        let reference = self.ground_truth.as_ref().filter(|_| self.moved);
        let Some(reference) = reference else { return self.estimate.framing_points_m() };
        let points = reference.framing_points_m();
        let middle = points.iter().sum::<Vector3<f64>>() / points.len().max(1) as f64;
        points.into_iter().map(|point| middle + (point - middle) * ROOM).collect()
    }

    /// Scene of the close-up in the IMU frame.
    pub(super) fn scene(&self, theme: &Theme) -> SceneModel {
        let mut scene = SceneModel::default();
        let length_m = self.axis_length_m();
        let axes = axis_colors(theme);
        if let Some(ground_truth) = &self.ground_truth {
            let faint = axes.map(|color| mix(theme.surface, color, 0.45));
            for pose in &ground_truth.imu_from_frame[1..] {
                scene.axes(pose, 0.7 * length_m, faint, 1.0);
            }
            let style = theme.ground_truth_style();
            scene.line(ground_truth.skeleton_m(), style.color, 1.2, style.dashes);
        }
        for pose in &self.estimate.imu_from_frame {
            scene.axes(pose, length_m, axes, 1.8);
        }
        self.links(theme, &mut scene);
        self.camera_symbol(theme, &mut scene);
        for (name, pose) in self.estimate.names.iter().zip(&self.estimate.imu_from_frame) {
            scene.label(pose.translation_m, name.clone(), theme.text_strong);
        }
        for (index, row) in self.rows.iter().enumerate() {
            let from = self.estimate.imu_from_frame[index + 1].translation_m;
            let corner = self.estimate.corners_m[index];
            let to = self.estimate.imu_from_frame[index + 2].translation_m;
            let number = index + 1;
            scene.label((from + corner) * 0.5, format!("d{number} {:.1}", row.d_m * 1e3), axes[2]);
            scene.label((corner + to) * 0.5, format!("a{number} {:.1}", row.a_m * 1e3), axes[0]);
        }
        scene
    }

    fn camera_symbol(&self, theme: &Theme, scene: &mut SceneModel) {
        let pose = self.estimate.imu_from_camera();
        let depth_m = 1.1 * self.axis_length_m();
        let corners = [[-0.6, -0.45], [0.6, -0.45], [0.6, 0.45], [-0.6, 0.45]]
            .map(|[x, y]| pose.transform(&(Vector3::new(x, y, 1.0) * depth_m)));
        let color = mix(theme.surface, theme.text_weak, 0.8);
        for (index, corner) in corners.iter().enumerate() {
            scene.segment(pose.translation_m, *corner, color, 1.0);
            scene.segment(*corner, corners[(index + 1) % 4], color, 1.0);
        }
    }

    /// Draws the rods: grey from the IMU to the base and from the effector to the camera; for each link its `d` in the
    /// colour of z and its `a` in the colour of x.
    fn links(&self, theme: &Theme, scene: &mut SceneModel) {
        const ROD: f32 = 3.0;
        let axes = axis_colors(theme);
        let origins: Vec<Vector3<f64>> = self.estimate.origins_m().collect();
        let count = origins.len();
        scene.segment(origins[0], origins[1], theme.text_weak, ROD);
        for (index, corner) in self.estimate.corners_m.iter().enumerate() {
            scene.segment(origins[index + 1], *corner, mix(theme.surface, axes[2], 0.7), ROD);
            scene.segment(*corner, origins[index + 2], mix(theme.surface, axes[0], 0.7), ROD);
        }
        if count > 2 {
            scene.segment(origins[count - 2], origins[count - 1], theme.text_weak, ROD);
        }
    }
}

impl ChainPose {
    /// All origins and the corners between them, as one line, in metres.
    pub(super) fn skeleton_m(&self) -> Vec<Vector3<f64>> {
        let mut points = Vec::new();
        for (index, origin) in self.origins_m().enumerate() {
            // The corner of a link is before the frame at its end; the first link ends at frame 2.
            if let Some(corner) = index.checked_sub(2).and_then(|link| self.corners_m.get(link)) {
                points.push(*corner);
            }
            points.push(origin);
        }
        points
    }
}

pub(super) fn axis_colors(theme: &Theme) -> [Color32; 3] {
    [theme.axis_x, theme.axis_y, theme.axis_z]
}
