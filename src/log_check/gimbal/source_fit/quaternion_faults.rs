//! Quaternions that a driver fills in wrongly: no entry of the rig describes them.

use nalgebra::{Quaternion, UnitQuaternion};

use crate::log_check::survey::attitude::AttitudeSurvey;

/// Fault of the quaternions of an attitude.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum QuaternionFault {
    /// Conjugates: they map the reference to the body.
    Inverse,
    /// The fields x, y, z, w contain w, x, y, z.
    ScalarFirst,
    /// The fields w, x, y, z contain x, y, z, w.
    ScalarLast,
}

/// Topics of the quaternions with a fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Faulty {
    Gimbal,
    Vehicle,
    Both,
}

/// Corrected attitudes with the fault that they had, in words.
pub(super) struct Corrected {
    pub(super) attitude: AttitudeSurvey,
    pub(super) fault: String,
}

impl QuaternionFault {
    const ALL: [Self; 3] = [Self::Inverse, Self::ScalarFirst, Self::ScalarLast];

    fn correct(self, read: &UnitQuaternion<f64>) -> UnitQuaternion<f64> {
        match self {
            Self::Inverse => read.inverse(),
            Self::ScalarFirst => UnitQuaternion::new_unchecked(Quaternion::new(read.i, read.j, read.k, read.w)),
            Self::ScalarLast => UnitQuaternion::new_unchecked(Quaternion::new(read.k, read.w, read.i, read.j)),
        }
    }

    fn describe(self) -> &'static str {
        match self {
            Self::Inverse => "are inverted: they rotate the other way",
            Self::ScalarFirst => "are in the order w, x, y, z: the fields x, y, z, w contain w, x, y, z",
            Self::ScalarLast => "are in the order x, y, z, w: the fields w, x, y, z contain x, y, z, w",
        }
    }
}

/// Attitudes without a fault that the recorded ones may have.
pub(super) fn corrected(attitude: &AttitudeSurvey) -> Vec<Corrected> {
    let places: &[Faulty] =
        if attitude.has_vehicle() { &[Faulty::Gimbal, Faulty::Vehicle, Faulty::Both] } else { &[Faulty::Gimbal] };
    let all = places.iter().flat_map(|faulty| QuaternionFault::ALL.map(|fault| (*faulty, fault)));
    let correct = |(faulty, fault): (Faulty, QuaternionFault)| {
        let change =
            |is_faulty: bool| move |read: &UnitQuaternion<f64>| if is_faulty { fault.correct(read) } else { *read };
        let topics = match (faulty, attitude.vehicle_topic()) {
            (Faulty::Gimbal, _) | (_, None) => attitude.topic().to_owned(),
            (Faulty::Vehicle, Some(vehicle)) => vehicle.to_owned(),
            (Faulty::Both, Some(vehicle)) => format!("{} and {vehicle}", attitude.topic()),
        };
        Corrected {
            attitude: attitude.with_rotations(change(faulty != Faulty::Vehicle), change(faulty != Faulty::Gimbal)),
            fault: format!("the quaternions of {topics} {}", fault.describe()),
        }
    };
    all.map(correct).collect()
}
