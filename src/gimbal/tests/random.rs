//! Random mechanisms from a seed.

use nalgebra::{UnitQuaternion, Vector3};

use crate::geometry::{RigidTransform, SplitMix64, so3};
use crate::gimbal::{ClassicalChain, DhLink};

pub(crate) struct Random(SplitMix64);

impl Random {
    pub(crate) fn new(seed: u64) -> Self {
        Self(SplitMix64::new(seed))
    }

    /// Uniform within `±bound`.
    pub(crate) fn within(&mut self, bound: f64) -> f64 {
        (self.0.next_unit() * 2.0 - 1.0) * bound
    }

    pub(crate) fn vector(&mut self, bound: f64) -> Vector3<f64> {
        Vector3::new(self.within(bound), self.within(bound), self.within(bound))
    }

    pub(crate) fn rotation(&mut self) -> UnitQuaternion<f64> {
        so3::exp(&self.vector(1.8))
    }

    pub(crate) fn transform(&mut self) -> RigidTransform {
        RigidTransform::new(self.rotation(), self.vector(0.4))
    }

    pub(crate) fn angles(&mut self, count: usize) -> Vec<f64> {
        (0..count).map(|_| self.within(3.1)).collect()
    }

    pub(crate) fn chain(&mut self, joints: usize) -> ClassicalChain {
        let links = (0..joints).map(|_| DhLink {
            theta_offset_rad: self.within(3.0),
            d_m: self.within(0.2),
            a_m: self.within(0.2),
            alpha_rad: self.within(3.0),
        });
        let links = links.collect();
        ClassicalChain { imu_from_base: self.transform(), links, effector_from_camera: self.transform() }
    }
}

/// Mechanisms at and near singularities: right angles, parallel and coaxial axes, a body-style camera.
pub(crate) fn special_chains() -> Vec<(&'static str, ClassicalChain)> {
    use std::f64::consts::{FRAC_PI_2, PI};
    let link = |theta_offset_rad, d_m, a_m, alpha_rad| DhLink { theta_offset_rad, d_m, a_m, alpha_rad };
    let links = vec![
        link(FRAC_PI_2, 0.0, 0.0, FRAC_PI_2),
        link(FRAC_PI_2, 0.0, 0.0, FRAC_PI_2),
        link(0.0, 0.0, 0.0, FRAC_PI_2),
    ];
    let optical = RigidTransform::new(so3::exp(&(Vector3::z() * FRAC_PI_2)), Vector3::zeros());
    let ideal = ClassicalChain { links, effector_from_camera: optical, ..ClassicalChain::default() };
    let mut roll_first = ideal.clone();
    roll_first.imu_from_base = RigidTransform::new(so3::exp(&(Vector3::y() * FRAC_PI_2)), Vector3::new(0.1, 0.0, 0.2));
    let mut pitch_first = ideal.clone();
    pitch_first.imu_from_base =
        RigidTransform::new(so3::exp(&(Vector3::x() * -FRAC_PI_2)), Vector3::new(0.1, 0.0, 0.2));
    let mut body_camera = ideal.clone();
    body_camera.links[2] = link(0.3, 0.02, 0.05, FRAC_PI_2);
    body_camera.effector_from_camera = RigidTransform::identity();
    let mut on_the_axis = body_camera.clone();
    on_the_axis.links[2].a_m = 0.0;
    let mut parallel = ideal.clone();
    parallel.links[0] = link(0.2, 0.1, 0.04, 0.0);
    let mut coaxial = ideal.clone();
    coaxial.links[0] = link(0.2, 0.1, 0.0, PI);
    let pan = ClassicalChain {
        links: vec![link(0.1, 0.05, 0.02, -FRAC_PI_2)],
        effector_from_camera: RigidTransform::new(UnitQuaternion::identity(), Vector3::new(0.01, 0.02, 0.03)),
        ..ClassicalChain::default()
    };
    vec![
        ("ideal", ideal),
        ("roll first", roll_first),
        ("pitch first", pitch_first),
        ("body camera", body_camera),
        ("camera on the last axis", on_the_axis),
        ("parallel axes", parallel),
        ("coaxial axes", coaxial),
        ("pan only", pan),
        ("nothing", ClassicalChain::default()),
    ]
}

/// Ten random chains of every length from 0 to 5, and the special ones.
pub(crate) fn all_chains() -> Vec<(String, ClassicalChain)> {
    let mut chains: Vec<_> = special_chains().into_iter().map(|(name, chain)| (name.to_owned(), chain)).collect();
    let mut random = Random::new(7);
    for joints in 0..=5 {
        for index in 0..10 {
            chains.push((format!("random {index} with {joints} joints"), random.chain(joints)));
        }
    }
    chains
}
