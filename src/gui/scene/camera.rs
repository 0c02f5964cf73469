//! Viewpoint of the scene and its projection onto the screen.
//!
//! No sine or cosine is computed unless the user rotates the view, so that screenshots do not depend on the system's
//! math library.

use nalgebra::{Unit, UnitQuaternion, Vector3};

/// Tangent of half the field of view along the shorter side of a viewport of the world.
const WORLD_HALF_TANGENT: f64 = 0.40;
/// The same for the close-up, where a small field of view reduces the perspective.
const CLOSE_UP_HALF_TANGENT: f64 = 0.08;
/// Ratio of the near distance to the distance of the target.
const NEAR_RATIO: f64 = 0.02;
/// Largest sine of the elevation; less than 1, so that the up direction stays defined.
const MAX_ELEVATION_SINE: f64 = 0.999;
/// Fraction of the viewport that framed points may fill.
const FRAME_RATIO: f64 = 0.86;

/// A camera that looks at a target, with the z axis up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct OrbitCamera {
    pub(super) target_m: Vector3<f64>,
    /// Unit vector from the target to the camera.
    pub(super) towards: Vector3<f64>,
    pub(super) distance_m: f64,
}

/// The screen rectangle of a view in pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Viewport {
    pub(super) size_px: [u32; 2],
    /// Left, top, right, bottom of the region for framing.
    pub(super) frame_px: [f64; 4],
    /// Tangent of half the field of view along the shorter side of that region.
    half_tangent: f64,
}

impl Viewport {
    /// Viewport of the world, with the region for framing.
    pub(super) fn world(size_px: [u32; 2], frame_px: [f64; 4]) -> Self {
        Self { size_px, frame_px, half_tangent: WORLD_HALF_TANGENT }
    }

    /// Viewport of a small object, framed in the whole size.
    pub(super) fn close_up(size_px: [u32; 2]) -> Self {
        let frame_px = [0.0, 0.0, f64::from(size_px[0]), f64::from(size_px[1])];
        Self { size_px, frame_px, half_tangent: CLOSE_UP_HALF_TANGENT }
    }

    fn centre_px(&self) -> [f64; 2] {
        let [left, top, right, bottom] = self.frame_px;
        [0.5 * (left + right), 0.5 * (top + bottom)]
    }

    fn half_size_px(&self) -> [f64; 2] {
        let [left, top, right, bottom] = self.frame_px;
        [0.5 * (right - left).max(1.0), 0.5 * (bottom - top).max(1.0)]
    }

    fn focal_px(&self) -> f64 {
        let [half_width, half_height] = self.half_size_px();
        half_width.min(half_height) / self.half_tangent
    }
}

/// A camera and its viewport, prepared for projection.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct SceneView {
    pub(super) camera: OrbitCamera,
    pub(super) viewport: Viewport,
    right: Vector3<f64>,
    up: Vector3<f64>,
    pub(super) near_m: f64,
}

/// A screen position: pixels from the upper left corner, and depth 1 at the near plane, 0 at infinity.
///
/// Depth is the near distance divided by the distance along the view, so it is linear over the screen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct ScreenPoint {
    pub(super) x_px: f64,
    pub(super) y_px: f64,
    pub(super) depth: f64,
}

impl ScreenPoint {
    /// Linear interpolation between two positions, also in depth.
    pub(super) fn lerp(&self, other: &Self, fraction: f64) -> Self {
        Self {
            x_px: self.x_px + (other.x_px - self.x_px) * fraction,
            y_px: self.y_px + (other.y_px - self.y_px) * fraction,
            depth: self.depth + (other.depth - self.depth) * fraction,
        }
    }
}

impl SceneView {
    pub(super) fn new(camera: OrbitCamera, viewport: Viewport) -> Self {
        let [right, up] = screen_axes(&camera.towards);
        Self { camera, viewport, right, up, near_m: (camera.distance_m * NEAR_RATIO).max(1e-6) }
    }

    /// Coordinates of a point in the view: right, up and forward, in metres.
    pub(super) fn in_view(&self, point_m: &Vector3<f64>) -> Vector3<f64> {
        let offset = point_m - self.camera.target_m;
        let away = self.camera.distance_m - self.camera.towards.dot(&offset);
        Vector3::new(self.right.dot(&offset), self.up.dot(&offset), away)
    }

    /// Screen position of a point at or behind the near plane, from [`SceneView::in_view`].
    pub(super) fn on_screen(&self, in_view_m: &Vector3<f64>) -> ScreenPoint {
        let [centre_x, centre_y] = self.viewport.centre_px();
        let scale = self.viewport.focal_px() / in_view_m.z;
        ScreenPoint {
            x_px: centre_x + in_view_m.x * scale,
            y_px: centre_y - in_view_m.y * scale,
            depth: self.near_m / in_view_m.z,
        }
    }

    /// Screen position of a point, `None` in front of the near plane.
    pub(super) fn project(&self, point_m: &Vector3<f64>) -> Option<ScreenPoint> {
        let in_view = self.in_view(point_m);
        (in_view.z >= self.near_m).then(|| self.on_screen(&in_view))
    }

    pub(super) fn metres_per_px(&self) -> f64 {
        self.camera.distance_m / self.viewport.focal_px()
    }

    /// Displacement of the target in metres when it is dragged over the screen.
    pub(super) fn drag_m(&self, drag_px: [f64; 2]) -> Vector3<f64> {
        (self.up * drag_px[1] - self.right * drag_px[0]) * self.metres_per_px()
    }
}

/// Right and up axes of a view from a direction.
pub(super) fn screen_axes(towards: &Vector3<f64>) -> [Vector3<f64>; 2] {
    let right = Vector3::z().cross(towards);
    let right = if right.norm() > 1e-9 { right.normalize() } else { Vector3::x() };
    [right, towards.cross(&right)]
}

/// A camera in direction `towards` that shows all points inside the viewport's region as large as possible.
pub(super) fn frame(points_m: &[Vector3<f64>], towards: Vector3<f64>, viewport: &Viewport) -> OrbitCamera {
    let finite = || points_m.iter().filter(|point| point.iter().all(|coordinate| coordinate.is_finite()));
    let Some(first) = finite().next() else {
        return OrbitCamera { target_m: Vector3::zeros(), towards, distance_m: 10.0 };
    };
    let (low, high) = finite().fold((*first, *first), |(low, high), point| (low.inf(point), high.sup(point)));
    let [right, up] = screen_axes(&towards);
    let smallest_m = ((high - low).norm() * 0.05).max(1e-3);
    let reach = viewport.half_size_px().map(|half| FRAME_RATIO * half / viewport.focal_px());
    let middle = (low + high) * 0.5;
    // A point at `across` and `nearer` (towards the camera) is inside when across − shift ≤ reach · (distance −
    // nearer). On each side this bounds the shift from above or below; the smallest distance is the one with equal
    // bounds.
    let solve = |axis: &Vector3<f64>, reach: f64| {
        let (highest, lowest) = finite().fold((f64::NEG_INFINITY, f64::INFINITY), |(highest, lowest), point| {
            let offset = point - middle;
            let (across, nearer) = (axis.dot(&offset), towards.dot(&offset) * reach);
            (highest.max(across + nearer), lowest.min(across - nearer))
        });
        ((highest - lowest) / (2.0 * reach), 0.5 * (highest + lowest))
    };
    let (across, shift_right) = solve(&right, reach[0]);
    let (upright, shift_up) = solve(&up, reach[1]);
    let distance_m = across.max(upright).max(smallest_m / reach[0].min(reach[1]));
    OrbitCamera { target_m: middle + right * shift_right + up * shift_up, towards, distance_m }
}

/// The user's rotation, shift and zoom of a view that otherwise frames its content.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Orbit {
    pub(super) towards: Vector3<f64>,
    pub(super) zoom: f64,
    pub(super) shift_m: Vector3<f64>,
}

impl Orbit {
    /// View from a non-zero direction without changes by the user.
    pub(super) fn from_direction(direction: Vector3<f64>) -> Self {
        Self { towards: direction.normalize(), zoom: 1.0, shift_m: Vector3::zeros() }
    }

    /// The framing camera with the user's changes.
    pub(super) fn applied(&self, framing: OrbitCamera) -> OrbitCamera {
        OrbitCamera {
            target_m: framing.target_m + self.shift_m,
            towards: self.towards,
            distance_m: framing.distance_m / self.zoom,
        }
    }

    /// Rotates the view by angles in radians: about z, and in elevation.
    pub(super) fn rotate(&mut self, about_z_rad: f64, up_rad: f64) {
        let [right, _] = screen_axes(&self.towards);
        let rotated = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), about_z_rad) * self.towards;
        let elevated = UnitQuaternion::from_axis_angle(&Unit::new_normalize(right), -up_rad) * self.towards;
        let level = Vector3::new(rotated.x, rotated.y, 0.0);
        let sine = elevated.z.clamp(-MAX_ELEVATION_SINE, MAX_ELEVATION_SINE);
        let went_over = elevated.x * self.towards.x + elevated.y * self.towards.y < 0.0;
        let sine = if went_over { MAX_ELEVATION_SINE.copysign(self.towards.z) } else { sine };
        if level.norm() > 1e-9 {
            let cosine = (1.0 - sine * sine).sqrt();
            self.towards = level.normalize() * cosine + Vector3::new(0.0, 0.0, sine);
        }
    }

    pub(super) fn zoom_by(&mut self, factor: f64) {
        self.zoom = (self.zoom * factor).clamp(0.02, 500.0);
    }
}

#[expect(clippy::imprecise_flops, reason = "a square root rounds alike everywhere, which `hypot` does not promise")]
pub(super) fn length(x: f64, y: f64) -> f64 {
    (x * x + y * y).sqrt()
}

/// The largest of 1, 2 or 5 times a power of ten at or below a length.
pub(super) fn round_length(upper_limit: f64) -> f64 {
    if !(upper_limit > 0.0 && upper_limit.is_finite()) {
        return 1.0;
    }
    let mut decade: f64 = 1.0;
    while decade > upper_limit {
        decade /= 10.0;
    }
    while decade * 10.0 <= upper_limit {
        decade *= 10.0;
    }
    [5.0, 2.0].into_iter().map(|step| step * decade).find(|length| *length <= upper_limit).unwrap_or(decade)
}
