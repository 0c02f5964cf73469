//! Experiments T1–T4 of the paper (§5.3) as flights through one of two environments.

use nalgebra::{Vector2, Vector3};

use super::aim::Aim;
use super::gimbal::LookAround;
use super::random::RandomStream;
use super::route::{Cruise, Flight, Manoeuvres, Path, Shuttle};
use crate::sensors::ChainPrior;
use crate::text::Named;

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Experiment {
    /// Random aggressive manoeuvres around a house (environment 1), 461 m.
    T1,
    /// Forward and backward, then left and right before the house (environment 1), 181 m.
    T2,
    /// Random aggressive manoeuvres between buildings (environment 2), 384 m.
    T3,
    /// As T3 with errors of 3 cm and 10° in the initial calibration and encoders of σ 7°, 456 m: online calibration.
    T4,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Environment {
    /// Environment 1: a house in its garden.
    House,
    /// Environment 2: buildings and roads.
    Town,
}

/// Surfaces of an environment that have texture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum WorldKind {
    /// Texture in every direction.
    #[default]
    Textured,
    /// Environment 1 with its house alone, on even ground under an even sky.
    Plain,
    /// Environment 2 with its buildings alone, on even ground under an even sky.
    Facades,
}

impl Named for WorldKind {
    const NAMES: &'static [(Self, &'static str)] =
        &[(Self::Textured, "textured"), (Self::Plain, "plain"), (Self::Facades, "facades")];
}

impl WorldKind {
    /// Environment that has this variant; `None` for a variant of both environments.
    pub fn environment(self) -> Option<Environment> {
        match self {
            Self::Textured => None,
            Self::Plain => Some(Environment::House),
            Self::Facades => Some(Environment::Town),
        }
    }
}

/// Side of a block of the town including half of the adjacent roads, in metres.
pub const TOWN_PITCH_M: f64 = 30.0;
/// Number of roads per direction of the town.
pub const TOWN_ROADS: usize = 4;

/// Names as in the paper and on the command line.
impl Named for Experiment {
    const NAMES: &'static [(Self, &'static str)] =
        &[(Self::T1, "T1"), (Self::T2, "T2"), (Self::T3, "T3"), (Self::T4, "T4")];
}

impl Experiment {
    pub fn environment(self) -> Environment {
        match self {
            Self::T1 | Self::T2 => Environment::House,
            Self::T3 | Self::T4 => Environment::Town,
        }
    }

    /// Length of the flight in the paper's Tables 2 and 3.
    pub fn length_m(self) -> f64 {
        match self {
            Self::T1 => 461.0,
            Self::T2 => 181.0,
            Self::T3 => 384.0,
            Self::T4 => 456.0,
        }
    }

    /// Standard deviation of the encoders: 7° in T4 (§5.4), otherwise 0.5°, which the paper does not specify.
    pub fn encoder_sigma_rad(self) -> f64 {
        match self {
            Self::T4 => 7_f64.to_radians(),
            _ => 0.5_f64.to_radians(),
        }
    }

    /// Error of the initial calibration: 3 cm and 10° in T4 (§5.4), otherwise 3 mm and 0.5°.
    pub fn start_error(self) -> ChainPrior {
        match self {
            Self::T4 => ChainPrior { translation_bound_m: 0.03, rotation_bound_rad: 10_f64.to_radians() },
            _ => ChainPrior { translation_bound_m: 0.003, rotation_bound_rad: 0.5_f64.to_radians() },
        }
    }

    /// Orientation of the gimbal camera.
    pub fn look_around(self, random: &mut RandomStream) -> LookAround {
        match self {
            // Towards the house, which lies to the left of the path.
            Self::T1 => LookAround::new([25.0, 25.0], [-6.0, 8.0], 0.0, random),
            Self::T2 => LookAround::new([0.0, 25.0], [-4.0, 7.0], 0.0, random),
            Self::T3 => LookAround::new([0.0, 30.0], [-6.0, 8.0], 0.0, random),
            // Calibration requires motion of all joints.
            Self::T4 => LookAround::new([0.0, 50.0], [-12.0, 18.0], 9.0, random),
        }
    }

    /// Direction of what there is to see, and a swing of this amplitude about it: the house in environment 1, the street
    /// ahead in environment 2.
    pub fn aim(self, swing_rad: f64) -> Aim {
        let target_m = (self.environment() == Environment::House).then(Vector2::zeros);
        Aim { target_m, swing_rad }
    }

    /// Flight of the experiment; a path that is not closed has at least this length.
    pub fn flight(self, length_m: f64, random: &mut RandomStream) -> Box<dyn Flight> {
        self.flight_at(Manoeuvres::aggressive(), length_m, random)
    }

    /// Flight with another pace.
    pub(crate) fn flight_at(self, pace: Manoeuvres, length_m: f64, random: &mut RandomStream) -> Box<dyn Flight> {
        match self {
            Self::T1 => {
                let (x, y) = (13.5, 12.0);
                let corners = [(0.0, -y), (x, -y), (x, y), (-x, y), (-x, -y)];
                let corners = corners.iter().map(|(x, y)| Vector2::new(*x, *y)).collect();
                let path = Path::new(corners, true, 5);
                Box::new(Cruise::new(pace, path, [2.6, 0.8], 1.3, 30_f64.to_radians(), random))
            }
            Self::T2 => Box::new(Shuttle {
                pace: Manoeuvres { manoeuvre_m: [0.4, 0.3], manoeuvre_heading_rad: 0.13, ..pace },
                centre_m: Vector3::new(4.5, -14.0, 2.3),
                heading_rad: std::f64::consts::FRAC_PI_2,
                stroke_m: 10.0,
                period_s: 5.6,
                forward_strokes: 5,
            }),
            Self::T3 | Self::T4 => {
                // Streets have a separate stream: a longer flight starts like a shorter one.
                let mut random_directions = RandomStream::new(random.next_u64(), 0);
                let path = Path::new(streets(length_m, &mut random_directions), false, 5);
                Box::new(Cruise::new(pace, path, [2.9, 0.8], 0.7, 0.0, random))
            }
        }
    }
}

/// Random walk through the streets of the town without reversals.
fn streets(length_m: f64, random: &mut RandomStream) -> Vec<Vector2<f64>> {
    let roads = TOWN_ROADS as i32;
    let position = |node: [i32; 2]| {
        let place = |k: i32| (f64::from(k) - 0.5 * f64::from(roads - 1)) * TOWN_PITCH_M;
        Vector2::new(place(node[0]), place(node[1]))
    };
    let inside = |node: [i32; 2]| node.iter().all(|k| (0..roads).contains(k));
    let mut node = [1 + random.index(2) as i32, 1 + random.index(2) as i32];
    let mut direction = [[1, 0], [0, 1], [-1, 0], [0, -1]][random.index(4)];
    let step = |node: [i32; 2], direction: [i32; 2]| [node[0] + direction[0], node[1] + direction[1]];
    let mut points = vec![position(node)];
    let blocks = (length_m / TOWN_PITCH_M).ceil() as usize + 3;
    for _ in 0..blocks {
        let next = step(node, direction);
        let along = Vector2::new(f64::from(direction[0]), f64::from(direction[1]));
        // Points near the crossings limit the rounding of corners to the crossings.
        points.push(position(node) + along * 7.0);
        points.push(position(next) - along * 7.0);
        points.push(position(next));
        node = next;
        let [x, y] = direction;
        let choices: Vec<[i32; 2]> =
            [[x, y], [-y, x], [y, -x]].into_iter().filter(|heading| inside(step(node, *heading))).collect();
        direction = choices[random.index(choices.len())];
    }
    points
}
