//! The degeneracy table (docs/mathematics.md, section 7): the expected results of its scenarios.
//!
//! Its column A, the paper's swap taken literally, is left out: that form cannot represent every mechanism and is not one
//! of the program's.

use super::LaboratoryMotion;

/// A column of the table.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Column {
    /// Classical, 12 + 4N.
    C,
    /// Classical without joint offsets.
    CWithout,
    /// Minimal, 4N + 6.
    M,
    /// Minimal without joint offsets.
    MWithout,
    /// The block swap at the end.
    B,
    /// The other base order.
    Mb,
    /// Product of exponentials.
    P,
}

/// What is known of the joint angles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Joints {
    Known,
    Prior(f64),
    Free,
}

/// What is known of the poses.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Poses {
    Known,
    BiasKnown,
    BiasFree,
}

/// One row: the scenario, and the expected ranks.
#[derive(Clone, Copy, Debug)]
pub(super) struct Truth {
    pub(super) scenario: &'static str,
    pub(super) mechanism: &'static str,
    pub(super) motion: LaboratoryMotion,
    /// Joints that do not move, counted from 1.
    pub(super) frozen: &'static [usize],
    pub(super) joints: Joints,
    pub(super) poses: Poses,
    pub(super) frames: usize,
    /// Columns and ranks.
    pub(super) ranks: &'static [(Column, usize)],
    /// Deficit of the first column by its four causes: parameterization, joints, absorbed, motion.
    pub(super) causes: Option<[usize; 4]>,
    /// Parameters of the null directions of the minimal parameterization, where the table names them all.
    pub(super) null_of_minimal: Option<&'static [&'static str]>,
}

/// A table of docs/mathematics.md, section 7.
#[derive(Clone, Copy, Debug)]
pub(super) struct Section {
    pub(super) title: &'static str,
    pub(super) rows: &'static [Truth],
}

use Column::{B, C, CWithout, M, MWithout, Mb, P};
use Joints::{Free, Known, Prior};
use LaboratoryMotion as Motion;

const OFFSET: &str = "yaw-roll-pitch-offset";
const IDEAL: &str = "yaw-roll-pitch-ideal";
const NOTHING: Option<&[&str]> = Some(&[]);
const OFFSETS: Option<&[&str]> = Some(&["L1.theta", "L2.theta", "L3.theta"]);

const fn row(scenario: &'static str, mechanism: &'static str) -> Truth {
    Truth {
        scenario,
        mechanism,
        motion: Motion::Aggressive,
        frozen: &[],
        joints: Known,
        poses: Poses::Known,
        frames: 10,
        ranks: &[],
        causes: None,
        null_of_minimal: None,
    }
}

const fn knowing(mut truth: Truth, joints: Joints, poses: Poses, frames: usize) -> Truth {
    truth.joints = joints;
    truth.poses = poses;
    truth.frames = frames;
    truth
}

const fn moving(mut truth: Truth, motion: Motion, frozen: &'static [usize]) -> Truth {
    truth.motion = motion;
    truth.frozen = frozen;
    truth
}

const fn says(
    mut truth: Truth,
    ranks: &'static [(Column, usize)],
    causes: [usize; 4],
    null_of_minimal: Option<&'static [&'static str]>,
) -> Truth {
    truth.ranks = ranks;
    truth.causes = Some(causes);
    truth.null_of_minimal = null_of_minimal;
    truth
}

const ALL_18: &[(Column, usize)] = &[(C, 18), (M, 18), (P, 18)];
const ALL_15: &[(Column, usize)] = &[(C, 15), (M, 15), (P, 15)];
const ALL_12: &[(Column, usize)] = &[(C, 12), (M, 12), (P, 12)];
const ALL_9: &[(Column, usize)] = &[(C, 9), (M, 9), (P, 9)];
const TWO_18: &[(Column, usize)] = &[(C, 18), (M, 18)];
const TWO_17: &[(Column, usize)] = &[(C, 17), (M, 17)];
const TWO_15: &[(Column, usize)] = &[(C, 15), (M, 15)];
const TWO_14: &[(Column, usize)] = &[(C, 14), (M, 14)];
const TWO_12: &[(Column, usize)] = &[(C, 12), (M, 12)];
const TWO_11: &[(Column, usize)] = &[(C, 11), (M, 11)];
const TWO_10: &[(Column, usize)] = &[(C, 10), (M, 10)];
const WITHOUT_15: &[(Column, usize)] = &[(CWithout, 15), (MWithout, 15)];

/// The tables of docs/mathematics.md, section 7.
pub(super) const SECTIONS: [Section; 6] = [
    Section {
        title: "Joint angles and poses (exciting motion)",
        rows: &[
            says(row("encoder known, poses known", OFFSET), ALL_18, [6, 0, 0, 0], NOTHING),
            says(row("encoder known, poses known, generic", "generic"), ALL_18, [6, 0, 0, 0], NOTHING),
            says(
                knowing(row("encoder known, IMU, bias known", OFFSET), Known, Poses::BiasKnown, 10),
                ALL_18,
                [6, 0, 0, 0],
                NOTHING,
            ),
            says(
                knowing(row("encoder known, IMU, bias free", OFFSET), Known, Poses::BiasFree, 10),
                ALL_18,
                [6, 0, 0, 0],
                NOTHING,
            ),
            says(
                knowing(row("encoder prior 7 deg, poses known", OFFSET), Prior(7.0), Poses::Known, 10),
                ALL_18,
                [6, 0, 0, 0],
                NOTHING,
            ),
            says(
                knowing(row("encoder prior 10 deg, IMU, bias free", OFFSET), Prior(10.0), Poses::BiasFree, 10),
                ALL_18,
                [6, 0, 0, 0],
                NOTHING,
            ),
            says(
                knowing(row("no encoder, poses known", OFFSET), Free, Poses::Known, 16),
                ALL_15,
                [6, 0, 3, 0],
                OFFSETS,
            ),
            says(
                knowing(row("no encoder, poses known, generic", "generic"), Free, Poses::Known, 16),
                ALL_15,
                [6, 0, 3, 0],
                OFFSETS,
            ),
            says(
                knowing(row("no encoder, IMU, bias known", OFFSET), Free, Poses::BiasKnown, 16),
                ALL_15,
                [6, 0, 3, 0],
                OFFSETS,
            ),
            says(
                knowing(row("no encoder, IMU, bias free, 10 frames", OFFSET), Free, Poses::BiasFree, 10),
                ALL_12,
                [6, 0, 3, 3],
                None,
            ),
            says(
                knowing(row("no encoder, IMU, bias free, 11 frames", OFFSET), Free, Poses::BiasFree, 11),
                ALL_15,
                [6, 0, 3, 0],
                OFFSETS,
            ),
            says(
                knowing(row("no encoder, ideal gimbal, poses known", IDEAL), Free, Poses::Known, 16),
                ALL_9,
                [6, 0, 9, 0],
                None,
            ),
            says(
                knowing(row("no encoder, ideal gimbal, IMU, bias known", IDEAL), Free, Poses::BiasKnown, 16),
                ALL_9,
                [6, 0, 9, 0],
                None,
            ),
            says(
                knowing(row("no encoder, ideal gimbal, IMU, bias free", IDEAL), Free, Poses::BiasFree, 16),
                ALL_9,
                [6, 0, 9, 0],
                None,
            ),
            says(
                knowing(row("no encoder, without offsets (21 and 15)", OFFSET), Free, Poses::Known, 16),
                WITHOUT_15,
                [4, 0, 2, 0],
                None,
            ),
        ],
    },
    Section {
        title: "Number of joints (12 + 4N columns, 4N + 6 identifiable)",
        rows: &[
            says(row("no joints", "rigid"), &[(C, 6), (M, 6), (P, 6)], [6, 0, 0, 0], NOTHING),
            says(row("one joint", "generic-1"), &[(C, 10), (M, 10), (P, 10)], [6, 0, 0, 0], NOTHING),
            says(row("two joints", "generic-2"), &[(C, 14), (M, 14), (P, 14)], [6, 0, 0, 0], NOTHING),
            says(row("three joints", "generic"), ALL_18, [6, 0, 0, 0], NOTHING),
            says(row("four joints", "generic-4"), &[(C, 22), (M, 22), (P, 22)], [6, 0, 0, 0], NOTHING),
        ],
    },
    Section {
        title: "Mechanisms (exciting, encoder known, poses known)",
        rows: &[
            says(row("generic", "generic"), &[(C, 18), (M, 18), (B, 18), (Mb, 18), (P, 18)], [6, 0, 0, 0], NOTHING),
            says(
                row("yaw-roll-pitch, 2-8 cm offsets, optical", OFFSET),
                &[(C, 18), (M, 18), (B, 18), (Mb, 18), (P, 18)],
                [6, 0, 0, 0],
                NOTHING,
            ),
            says(
                row("yaw-roll-pitch, axes intersect, optical", IDEAL),
                &[(C, 18), (M, 18), (B, 17), (Mb, 18), (P, 18)],
                [6, 0, 0, 0],
                NOTHING,
            ),
            says(
                row("yaw-roll-pitch, camera frame FLU", "yaw-roll-pitch-flu"),
                &[(C, 18), (M, 17), (B, 18), (Mb, 17), (P, 18)],
                [6, 0, 0, 0],
                Some(&["L3.d", "L3.y"]),
            ),
            says(
                row("same, camera centre on the last axis", "yaw-roll-pitch-flu-centred"),
                &[(C, 18), (M, 16), (B, 18), (Mb, 16), (P, 18)],
                [6, 0, 0, 0],
                Some(&["L3.theta", "L3.d", "L3.beta", "L3.y"]),
            ),
            says(
                row("pitch-roll-yaw, optical", "pitch-roll-yaw"),
                &[(C, 18), (M, 17), (B, 18), (Mb, 16), (P, 18)],
                [6, 0, 0, 0],
                Some(&["L3.d", "L3.y"]),
            ),
            says(
                row("roll first (first axis || IMU x)", "roll-first"),
                &[(C, 18), (M, 17), (B, 17), (Mb, 18), (P, 18)],
                [6, 0, 0, 0],
                Some(&["I.rx", "I.tx", "I.ty", "L1.theta"]),
            ),
            says(
                row("axes 1, 2 parallel", "parallel-axes"),
                &[(C, 17), (M, 17), (B, 17), (Mb, 17), (P, 18)],
                [7, 0, 0, 0],
                Some(&["L1.d", "L2.d"]),
            ),
            says(
                row("axes 2, 3 parallel", "parallel-axes-2-3"),
                &[(C, 17), (M, 17), (B, 17), (Mb, 17), (P, 18)],
                [7, 0, 0, 0],
                Some(&["L2.d", "L3.d"]),
            ),
            says(
                row("axes 1, 2 coaxial", "coaxial-axes"),
                &[(C, 16), (M, 16), (B, 16), (Mb, 16), (P, 18)],
                [8, 0, 0, 0],
                Some(&["L1.theta", "L1.d", "L2.theta", "L2.d"]),
            ),
            says(
                row("pan only, optical", "one-joint"),
                &[(C, 10), (M, 9), (B, 10), (Mb, 9), (P, 10)],
                [6, 0, 0, 0],
                Some(&["L1.d", "L1.y"]),
            ),
            says(row("pan-tilt", "pan-tilt"), &[(C, 14), (M, 14), (B, 14), (Mb, 14), (P, 14)], [6, 0, 0, 0], NOTHING),
        ],
    },
    Section {
        title: "Joints that do not move (identifiable = 4 N_moving + 6)",
        rows: &[
            says(moving(row("joints 1, 2 move", OFFSET), Motion::Aggressive, &[3]), TWO_14, [6, 4, 0, 0], None),
            says(moving(row("joints 1, 3 move", OFFSET), Motion::Aggressive, &[2]), TWO_14, [6, 4, 0, 0], None),
            says(moving(row("joints 2, 3 move", OFFSET), Motion::Aggressive, &[1]), TWO_14, [6, 4, 0, 0], None),
            says(
                moving(row("joints 1, 2 move, generic", "generic"), Motion::Aggressive, &[3]),
                TWO_14,
                [6, 4, 0, 0],
                None,
            ),
            says(moving(row("joint 1 moves", OFFSET), Motion::Aggressive, &[2, 3]), TWO_10, [6, 8, 0, 0], None),
            says(moving(row("joint 2 moves", OFFSET), Motion::Aggressive, &[1, 3]), TWO_10, [6, 8, 0, 0], None),
            says(moving(row("joint 3 moves", OFFSET), Motion::Aggressive, &[1, 2]), TWO_10, [6, 8, 0, 0], None),
            says(
                moving(row("no joint moves", OFFSET), Motion::Aggressive, &[1, 2, 3]),
                &[(C, 6), (M, 6)],
                [6, 12, 0, 0],
                None,
            ),
            says(
                moving(row("joint 2 rests, axes 1, 3 parallel", "outer-parallel"), Motion::Aggressive, &[2]),
                TWO_14,
                [6, 4, 0, 0],
                None,
            ),
            says(
                knowing(
                    moving(row("no encoder, joints 1, 3 move", OFFSET), Motion::Aggressive, &[2]),
                    Free,
                    Poses::Known,
                    16,
                ),
                TWO_11,
                [6, 4, 3, 0],
                None,
            ),
            says(
                knowing(
                    moving(row("no encoder, joint 1 moves", OFFSET), Motion::Aggressive, &[2, 3]),
                    Free,
                    Poses::Known,
                    16,
                ),
                &[(C, 7), (M, 7)],
                [6, 8, 3, 0],
                None,
            ),
            says(
                knowing(
                    moving(row("no encoder, no joint moves", OFFSET), Motion::Aggressive, &[1, 2, 3]),
                    Free,
                    Poses::Known,
                    16,
                ),
                &[(C, 3), (M, 3)],
                [6, 12, 3, 0],
                None,
            ),
        ],
    },
    Section {
        title: "Motion of vehicle and camera (encoder known)",
        rows: &[
            says(
                moving(row("pure translation", OFFSET), Motion::TranslationOnly, &[]),
                TWO_15,
                [6, 0, 0, 3],
                Some(&["I.tx", "I.ty", "L1.d"]),
            ),
            says(moving(row("hover", OFFSET), Motion::Hover, &[]), TWO_11, [6, 0, 0, 7], None),
            says(
                knowing(
                    moving(row("constant velocity, IMU", OFFSET), Motion::ConstantVelocity, &[]),
                    Known,
                    Poses::BiasFree,
                    10,
                ),
                TWO_11,
                [6, 0, 0, 7],
                None,
            ),
            says(moving(row("yaw only + translation", OFFSET), Motion::YawOnly, &[]), TWO_17, [6, 0, 0, 1], None),
            says(moving(row("the same in the plane", OFFSET), Motion::YawPlanar, &[]), TWO_17, [6, 0, 0, 1], None),
            says(moving(row("the same, body tilted", OFFSET), Motion::YawTilted, &[]), TWO_17, [6, 0, 0, 1], None),
            says(moving(row("yaw in place", OFFSET), Motion::YawInPlace, &[]), TWO_15, [6, 0, 0, 3], None),
            says(moving(row("rotation only", OFFSET), Motion::RotationOnly, &[]), TWO_17, [6, 0, 0, 1], None),
            says(
                knowing(
                    moving(row("constant velocity + rotation, IMU", OFFSET), Motion::ConstantVelocityRotation, &[]),
                    Known,
                    Poses::BiasFree,
                    10,
                ),
                TWO_17,
                [6, 0, 0, 1],
                None,
            ),
            says(
                moving(row("straight line, accelerated, rotating", OFFSET), Motion::StraightLine, &[]),
                TWO_18,
                [6, 0, 0, 0],
                NOTHING,
            ),
            says(
                moving(row("camera never rotates in the world", OFFSET), Motion::Stabilized, &[]),
                TWO_15,
                [6, 0, 0, 3],
                Some(&["L3.d", "L3.a", "L3.y"]),
            ),
            says(
                knowing(
                    moving(row("the same, IMU, bias free", OFFSET), Motion::Stabilized, &[]),
                    Known,
                    Poses::BiasFree,
                    10,
                ),
                TWO_15,
                [6, 0, 0, 3],
                Some(&["L3.d", "L3.a", "L3.y"]),
            ),
            says(moving(row("camera follows yaw only", OFFSET), Motion::YawFollowing, &[]), TWO_17, [6, 0, 0, 1], None),
            says(
                moving(row("stabilised + rotation only", OFFSET), Motion::StabilizedRotationOnly, &[]),
                TWO_14,
                [6, 0, 0, 4],
                None,
            ),
            says(
                moving(row("stabilised + pure translation", OFFSET), Motion::StabilizedTranslationOnly, &[]),
                &[(C, 3), (M, 3)],
                [6, 12, 0, 3],
                None,
            ),
        ],
    },
    Section {
        title: "Motion without encoders",
        rows: &[
            says(
                knowing(moving(row("pure translation", OFFSET), Motion::TranslationOnly, &[]), Free, Poses::Known, 16),
                TWO_12,
                [6, 0, 3, 3],
                None,
            ),
            says(
                knowing(moving(row("hover", OFFSET), Motion::Hover, &[]), Free, Poses::Known, 16),
                &[(C, 9), (M, 9)],
                [6, 0, 3, 6],
                None,
            ),
            says(
                knowing(moving(row("yaw only + translation", OFFSET), Motion::YawOnly, &[]), Free, Poses::Known, 16),
                TWO_14,
                [6, 0, 3, 1],
                None,
            ),
            says(
                knowing(
                    moving(row("camera never rotates in the world", OFFSET), Motion::Stabilized, &[]),
                    Free,
                    Poses::Known,
                    16,
                ),
                TWO_12,
                [6, 0, 3, 3],
                None,
            ),
            says(
                knowing(
                    moving(row("stabilised + pure translation", OFFSET), Motion::StabilizedTranslationOnly, &[]),
                    Free,
                    Poses::Known,
                    16,
                ),
                &[(C, 0), (M, 0)],
                [6, 12, 3, 3],
                None,
            ),
        ],
    },
];

/// A number of frames from which on a window identifies everything that it can (three joints, generic).
#[derive(Clone, Copy, Debug)]
pub(super) struct LeastFrames {
    pub(super) scenario: &'static str,
    pub(super) joints: Joints,
    pub(super) poses: Poses,
    /// The rank to be reached in the minimal form.
    pub(super) rank: usize,
    /// Expected number of frames: least and most, where the table leaves it open.
    pub(super) frames: (usize, usize),
}

/// The least numbers of frames.
pub(super) const LEAST_FRAMES: [LeastFrames; 6] = [
    LeastFrames { scenario: "encoder, poses known", joints: Known, poses: Poses::Known, rank: 18, frames: (5, 5) },
    LeastFrames {
        scenario: "encoder, IMU, bias known",
        joints: Known,
        poses: Poses::BiasKnown,
        rank: 18,
        frames: (6, 6),
    },
    LeastFrames {
        scenario: "encoder, IMU, bias free",
        joints: Known,
        poses: Poses::BiasFree,
        rank: 18,
        frames: (7, 7),
    },
    LeastFrames { scenario: "no encoder, poses known", joints: Free, poses: Poses::Known, rank: 15, frames: (8, 8) },
    LeastFrames {
        scenario: "no encoder, IMU, bias known",
        joints: Free,
        poses: Poses::BiasKnown,
        rank: 15,
        frames: (9, 10),
    },
    LeastFrames {
        scenario: "no encoder, IMU, bias free",
        joints: Free,
        poses: Poses::BiasFree,
        rank: 15,
        frames: (11, 11),
    },
];
