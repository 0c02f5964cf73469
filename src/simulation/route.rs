//! Routes of the experiments in plan view, with velocity, height, heading and random manoeuvres.

use nalgebra::{Vector2, Vector3};

use super::exercise::Exercise;
use super::random::RandomStream;
use crate::geometry::{smooth_step, wrap_angle};

/// Reference position and heading of a flight at one time.
#[derive(Clone, Copy, Debug)]
pub struct FlightPoint {
    /// Position in the world.
    pub position_m: Vector3<f64>,
    /// Standard deviation of the random manoeuvres, per axis of the world.
    pub(crate) position_wander_m: Vector3<f64>,
    /// Heading, continuous over time.
    pub heading_rad: f64,
    /// Standard deviation of the random manoeuvres in heading.
    pub(crate) heading_wander_rad: f64,
}

/// Reference of a trajectory, without its random manoeuvres.
pub trait Flight {
    /// Time between two manoeuvres, in seconds.
    fn knot_s(&self) -> f64 {
        0.65
    }

    /// Reference at a time after the start.
    fn point(&self, time_s: f64) -> FlightPoint;
}

/// Flight mirrored at the x–z plane: an orbit to the left becomes one to the right.
pub struct Mirrored(pub Box<dyn Flight>);

impl Flight for Mirrored {
    fn knot_s(&self) -> f64 {
        self.0.knot_s()
    }

    fn point(&self, time_s: f64) -> FlightPoint {
        let point = self.0.point(time_s);
        let mirror = Vector3::new(1.0, -1.0, 1.0);
        FlightPoint { position_m: point.position_m.component_mul(&mirror), heading_rad: -point.heading_rad, ..point }
    }
}

/// Speed and size of the manoeuvres of a flight.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Manoeuvres {
    /// Duration of the hover at the start.
    pub(crate) hover_s: f64,
    /// Sway while hovering (standard deviation).
    pub(crate) sway_m: f64,
    /// Time from hover to full velocity.
    pub(crate) ramp_s: f64,
    /// Velocity along the route after the ramp.
    pub(crate) speed_m_per_s: f64,
    /// Horizontal and vertical manoeuvres (standard deviations of the spline's control points).
    pub(crate) manoeuvre_m: [f64; 2],
    /// Pace in heading (standard deviation of the spline's control points).
    pub(crate) manoeuvre_heading_rad: f64,
}

impl Manoeuvres {
    /// Two seconds of near-hover, then random aggressive manoeuvres.
    pub(crate) fn aggressive() -> Self {
        Self {
            hover_s: 2.0,
            sway_m: 0.012,
            ramp_s: 3.0,
            speed_m_per_s: 3.0,
            manoeuvre_m: [0.85, 0.55],
            manoeuvre_heading_rad: 0.2,
        }
    }

    /// Progress of the ramp: 0 while hovering, 1 at full velocity, smooth in between.
    pub(crate) fn liveliness(&self, time_s: f64) -> f64 {
        let fraction = ((time_s - self.hover_s) / self.ramp_s).clamp(0.0, 1.0);
        smooth_step(fraction)
    }

    /// Equivalent time at full velocity; its derivative is [`Self::liveliness`].
    pub(crate) fn moving_time_s(&self, time_s: f64) -> f64 {
        let fraction = ((time_s - self.hover_s) / self.ramp_s).clamp(0.0, 1.0);
        let ramp = fraction.powi(4) * (fraction * (fraction - 3.0) + 2.5);
        let after = (time_s - self.hover_s - self.ramp_s).max(0.0);
        ramp * self.ramp_s + after
    }

    fn position_wander_m(&self, time_s: f64) -> Vector3<f64> {
        let fraction = self.liveliness(time_s);
        let blend = |full: f64| self.sway_m + (full - self.sway_m) * fraction;
        Vector3::new(blend(self.manoeuvre_m[0]), blend(self.manoeuvre_m[0]), blend(self.manoeuvre_m[1]))
    }

    fn heading_wander_rad(&self, time_s: f64) -> f64 {
        self.sway_m * 0.3 + self.manoeuvre_heading_rad * self.liveliness(time_s)
    }
}

/// Slow wave: two sines with random phases, with a total amplitude of about one.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Wave {
    period_s: [f64; 2],
    phase_rad: [f64; 2],
}

impl Wave {
    pub(crate) fn new(random: &mut RandomStream, period_s: f64) -> Self {
        let mut phase = || random.uniform(0.0, std::f64::consts::TAU);
        Self { period_s: [period_s, period_s * 0.557], phase_rad: [phase(), phase()] }
    }

    pub(crate) fn at(&self, time_s: f64) -> f64 {
        let sine = |k: usize| (std::f64::consts::TAU * time_s / self.period_s[k] + self.phase_rad[k]).sin();
        0.65 * sine(0) + 0.35 * sine(1)
    }
}

/// Polyline in plan view, parameterized by length; a closed one is repeated.
#[derive(Clone, Debug)]
pub(crate) struct Path {
    points: Vec<Vector2<f64>>,
    length_m: Vec<f64>,
    heading_rad: Vec<f64>,
    closed: bool,
}

impl Path {
    /// Path through points whose corners are rounded by cutting them `cuts` times.
    pub(crate) fn new(mut points: Vec<Vector2<f64>>, closed: bool, cuts: usize) -> Self {
        for _ in 0..cuts {
            points = cut_corners(&points, closed);
        }
        if closed && let Some(first) = points.first().copied() {
            points.push(first);
        }
        let mut sum = 0.0;
        let mut length_m = vec![0.0];
        let mut heading_rad: Vec<f64> = Vec::with_capacity(points.len());
        for pair in points.windows(2) {
            let step = pair[1] - pair[0];
            sum += step.norm();
            length_m.push(sum);
            let angle = step.y.atan2(step.x);
            heading_rad.push(heading_rad.last().map_or(angle, |before| before + wrap_angle(angle - before)));
        }
        Self { points, length_m, heading_rad, closed }
    }

    /// Point at this distance along the path, and its direction as a continuous heading.
    pub(crate) fn at(&self, along_m: f64) -> (Vector2<f64>, f64) {
        let total = self.length_m.last().copied().unwrap_or(0.0).max(1e-9);
        let laps = if self.closed { (along_m / total).floor() } else { 0.0 };
        let rest = along_m - laps * total;
        let after = self.length_m.partition_point(|length| *length <= rest).clamp(1, self.points.len() - 1);
        let (from, to) = (self.points[after - 1], self.points[after]);
        let step = to - from;
        let fraction = (rest - self.length_m[after - 1]) / step.norm().max(1e-12);
        let heading_change = if self.closed { self.heading_change_rad() * laps } else { 0.0 };
        (from + step * fraction, self.heading_rad[after - 1] + heading_change)
    }

    /// Change of direction over one round of a closed path.
    fn heading_change_rad(&self) -> f64 {
        let area: f64 = self.points.windows(2).map(|pair| pair[0].x * pair[1].y - pair[1].x * pair[0].y).sum();
        std::f64::consts::TAU.copysign(area)
    }
}

/// Smooths a polygon by one round of Chaikin's corner cutting (1974).
fn cut_corners(points: &[Vector2<f64>], closed: bool) -> Vec<Vector2<f64>> {
    let count = points.len();
    if count < 3 {
        return points.to_vec();
    }
    let mut cut = Vec::with_capacity(2 * count);
    if !closed {
        cut.push(points[0]);
    }
    let segments = if closed { count } else { count - 1 };
    for k in 0..segments {
        let (from, to) = (points[k], points[(k + 1) % count]);
        cut.push(from * 0.75 + to * 0.25);
        cut.push(from * 0.25 + to * 0.75);
    }
    if !closed {
        cut.push(points[count - 1]);
    }
    cut
}

/// Flight along a path with slowly varying velocity, height and lateral distance.
#[derive(Clone, Debug)]
pub(crate) struct Cruise {
    pub(crate) pace: Manoeuvres,
    /// Ground track in metres.
    pub(crate) path: Path,
    /// Height above ground, and its variation.
    pub(crate) height_m: [f64; 2],
    /// Amplitude of the lateral distance from the path.
    pub(crate) wander_m: f64,
    /// Heading relative to the path's direction, positive to the left.
    pub(crate) heading_offset_rad: f64,
    waves: [Wave; 4],
}

impl Cruise {
    pub(crate) fn new(
        pace: Manoeuvres,
        path: Path,
        height_m: [f64; 2],
        wander_m: f64,
        offset_rad: f64,
        random: &mut RandomStream,
    ) -> Self {
        let waves =
            [Wave::new(random, 17.0), Wave::new(random, 13.3), Wave::new(random, 21.7), Wave::new(random, 11.1)];
        Self { pace, path, height_m, wander_m, heading_offset_rad: offset_rad, waves }
    }
}

impl Flight for Cruise {
    fn point(&self, time_s: f64) -> FlightPoint {
        let moving_time_s = self.pace.moving_time_s(time_s);
        // The wave starts without displacement, so that the vehicle hovers.
        let since = |wave: &Wave| wave.at(moving_time_s) - wave.at(0.0) * (-moving_time_s / 4.0).exp();
        let speed_swing_m = 1.6 * self.pace.speed_m_per_s * since(&self.waves[0]) * 0.5;
        let along_m =
            self.pace.speed_m_per_s * moving_time_s + speed_swing_m.max(-self.pace.speed_m_per_s * moving_time_s);
        let (on_path, _) = self.path.at(along_m);
        // The heading follows a chord ahead, so that it changes before the corner.
        let (_, direction) = self.path.at(along_m);
        let (_, ahead) = self.path.at(along_m + 2.5);
        let side = Vector2::new(-direction.sin(), direction.cos()) * (self.wander_m * since(&self.waves[1]));
        let height_m = self.height_m[0] + self.height_m[1] * since(&self.waves[2]);
        FlightPoint {
            position_m: Vector3::new(on_path.x + side.x, on_path.y + side.y, height_m),
            position_wander_m: self.pace.position_wander_m(time_s),
            heading_rad: 0.5 * (direction + ahead) + self.heading_offset_rad + 0.35 * since(&self.waves[3]),
            heading_wander_rad: self.pace.heading_wander_rad(time_s),
        }
    }
}

/// Forward and backward along the heading, then left and right: experiment T2.
#[derive(Clone, Debug)]
pub(crate) struct Shuttle {
    pub(crate) pace: Manoeuvres,
    /// Centre of the strokes.
    pub(crate) centre_m: Vector3<f64>,
    pub(crate) heading_rad: f64,
    /// Length of a stroke from end to end.
    pub(crate) stroke_m: f64,
    /// Period of a stroke forward and back.
    pub(crate) period_s: f64,
    /// Number of strokes forward and back before those to the left and right.
    pub(crate) forward_strokes: u32,
}

impl Flight for Shuttle {
    fn point(&self, time_s: f64) -> FlightPoint {
        let moving_time_s = self.pace.moving_time_s(time_s);
        let strokes = moving_time_s / self.period_s;
        let forward_strokes = f64::from(self.forward_strokes);
        let swing = -(std::f64::consts::TAU * strokes).cos() * 0.5 * self.stroke_m;
        // Each half starts and ends at the rear end of the forward stroke; the left–right half starts on the right.
        let (ahead_m, left_m) =
            if strokes < forward_strokes { (swing, 0.0) } else { (-0.5 * self.stroke_m, swing + 0.5 * self.stroke_m) };
        let (sine, cosine) = self.heading_rad.sin_cos();
        let shift = Vector3::new(cosine * ahead_m - sine * left_m, sine * ahead_m + cosine * left_m, 0.0);
        FlightPoint {
            position_m: self.centre_m + shift,
            position_wander_m: self.pace.position_wander_m(time_s),
            heading_rad: self.heading_rad,
            heading_wander_rad: self.pace.heading_wander_rad(time_s),
        }
    }
}

/// Flight at one position, with the pace's sway and, after the ramp, its manoeuvres.
#[derive(Clone, Debug)]
pub(crate) struct Station {
    pub(crate) pace: Manoeuvres,
    pub(crate) position_m: Vector3<f64>,
    pub(crate) heading_rad: f64,
}

/// Flight at one position with a warm-up, then an exercise that starts from hover.
#[derive(Clone, Debug)]
pub(crate) struct Drill {
    pub(crate) position_m: Vector3<f64>,
    pub(crate) heading_rad: f64,
    pub(crate) start_s: f64,
    pub(crate) exercise: Exercise,
}

impl Drill {
    /// Duration of the hover before and after the warm-up.
    const REST_S: f64 = 1.0;

    /// Amplitude of the warm-up at a time as a ratio of its largest value: 0 while hovering.
    fn liveliness(&self, time_s: f64) -> f64 {
        let (begin_s, end_s) = (Self::REST_S, self.start_s - Self::REST_S);
        let fraction = ((time_s - begin_s) / (end_s - begin_s).max(1e-3)).clamp(0.0, 1.0);
        (std::f64::consts::PI * fraction).sin().powi(2)
    }
}

impl Flight for Drill {
    fn knot_s(&self) -> f64 {
        0.1
    }

    fn point(&self, time_s: f64) -> FlightPoint {
        let wave =
            |size: f64, period_s: f64, phase: f64| size * (std::f64::consts::TAU * time_s / period_s + phase).sin();
        let warm_up = Vector3::new(wave(0.8, 2.9, 0.0), wave(0.7, 2.3, 1.0), wave(0.4, 2.1, 2.0));
        let liveliness = self.liveliness(time_s);
        let exercise_s = (time_s - self.start_s).max(0.0);
        let (sine, cosine) = self.heading_rad.sin_cos();
        let shift = self.exercise.shift_m(exercise_s);
        let shift = Vector3::new(cosine * shift.x - sine * shift.y, sine * shift.x + cosine * shift.y, shift.z);
        FlightPoint {
            position_m: self.position_m + warm_up * liveliness + shift,
            position_wander_m: Vector3::zeros(),
            heading_rad: self.heading_rad
                + liveliness * wave(0.4, 3.7, 0.5)
                + self.exercise.heading_change_rad(exercise_s),
            heading_wander_rad: 0.0,
        }
    }
}

impl Flight for Station {
    fn point(&self, time_s: f64) -> FlightPoint {
        FlightPoint {
            position_m: self.position_m,
            position_wander_m: self.pace.position_wander_m(time_s),
            heading_rad: self.heading_rad,
            heading_wander_rad: self.pace.heading_wander_rad(time_s),
        }
    }
}
