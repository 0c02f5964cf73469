//! Content of a scene in metres in one frame, common to all backends.

use std::sync::Arc;

use egui::Color32;
use nalgebra::Vector3;

use crate::geometry::RigidTransform;
use crate::sensors::GrayImage;

#[derive(Clone, Debug, PartialEq)]
pub(super) struct Line {
    pub(super) points_m: Vec<Vector3<f64>>,
    pub(super) color: Color32,
    /// Width on the screen in points.
    pub(super) width: f32,
    /// Lengths of dash, gap, … on the screen in points; empty for a solid line.
    pub(super) dashes: &'static [f32],
}

/// A dot of constant size on the screen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Dot {
    pub(super) position_m: Vector3<f64>,
    pub(super) color: Color32,
    /// Radius on the screen in points.
    pub(super) radius: f32,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Face {
    pub(super) corners_m: [Vector3<f64>; 3],
    pub(super) color: Color32,
}

/// An image on a rectangle: corners top left, top right, bottom right, bottom left.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct ImageQuad {
    pub(super) corners_m: [Vector3<f64>; 4],
    pub(super) image: Arc<GrayImage>,
}

/// A text next to a point.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Label {
    pub(super) position_m: Vector3<f64>,
    pub(super) text: String,
    pub(super) color: Color32,
}

#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct SceneModel {
    pub(super) lines: Vec<Line>,
    pub(super) dots: Vec<Dot>,
    pub(super) faces: Vec<Face>,
    pub(super) images: Vec<ImageQuad>,
    /// Labels by priority, highest first.
    pub(super) labels: Vec<Label>,
}

impl SceneModel {
    /// A solid line between two points.
    pub(super) fn segment(&mut self, from_m: Vector3<f64>, to_m: Vector3<f64>, color: Color32, width: f32) {
        self.line(vec![from_m, to_m], color, width, &[]);
    }

    /// A line through several points; nothing for fewer than two.
    pub(super) fn line(&mut self, points_m: Vec<Vector3<f64>>, color: Color32, width: f32, dashes: &'static [f32]) {
        if points_m.len() > 1 {
            self.lines.push(Line { points_m, color, width, dashes });
        }
    }

    /// The three axes of a frame; `colors` of x, y, z.
    pub(super) fn axes(&mut self, pose: &RigidTransform, length_m: f64, colors: [Color32; 3], width: f32) {
        for (axis, color) in colors.into_iter().enumerate() {
            let mut tip = Vector3::zeros();
            tip[axis] = length_m;
            self.segment(pose.translation_m, pose.transform(&tip), color, width);
        }
    }

    pub(super) fn label(&mut self, position_m: Vector3<f64>, text: impl Into<String>, color: Color32) {
        self.labels.push(Label { position_m, text: text.into(), color });
    }
}
