//! Elements of a drawing.

use egui::{Color32, Pos2, Rect, Stroke, TextureId, Vec2};

/// Element of a drawing; positions and sizes are in points, y points down.
#[derive(Clone, Debug, PartialEq)]
pub enum Element {
    /// Clip rectangle of the elements after this one; `None` for the whole drawing.
    Clip(Option<Rect>),
    /// Rotation by an angle (rad, clockwise) about a point, of the elements after this one; `None` ends it.
    Rotation(Option<(f32, Pos2)>),
    /// Straight lines of one stroke, painted together: where translucent lines overlap, they do not add up.
    Lines {
        lines: Vec<[Pos2; 2]>,
        stroke: Stroke,
    },
    /// Line or area through points, with round joins.
    Outline {
        points: Vec<Pos2>,
        closed: bool,
        fill: Color32,
        stroke: Stroke,
    },
    Circle {
        center: Pos2,
        radius: f32,
        fill: Color32,
        stroke: Stroke,
    },
    Ellipse {
        center: Pos2,
        radius: Vec2,
        angle_rad: f32,
        fill: Color32,
        stroke: Stroke,
    },
    /// Rectangle, rotated about its centre; the stroke is centred on its outline.
    Rect {
        rect: Rect,
        corner_radius: f32,
        angle_rad: f32,
        fill: Color32,
        stroke: Stroke,
    },
    /// Areas of one colour, painted together.
    Areas {
        areas: Vec<FilledArea>,
        fill: Color32,
    },
    /// Region `uv` (0 to 1) of a texture in a rectangle.
    Image {
        texture: TextureId,
        rect: Rect,
        uv: Rect,
    },
    Text(TextRun),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FilledArea {
    Rect(Rect),
    /// Corners clockwise on the screen.
    Triangle([Pos2; 3]),
}

/// Letters of one font and colour on one line.
#[derive(Clone, Debug, PartialEq)]
pub struct TextRun {
    /// Baseline in points from the top of the drawing.
    pub y: f32,
    /// Font size in points.
    pub size: f32,
    pub monospace: bool,
    pub italics: bool,
    pub color: Color32,
    pub letters: Vec<Letter>,
}

/// A letter of a run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Letter {
    pub letter: char,
    /// Left end in points from the left of the drawing.
    pub x: f32,
    /// Width in the layout, in points.
    pub width: f32,
}
