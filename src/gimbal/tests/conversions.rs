use std::f64::consts::FRAC_PI_2;

use nalgebra::{DVector, UnitQuaternion, Vector3};

use super::random::{Random, all_chains, special_chains};
use crate::geometry::RigidTransform;
use crate::gimbal::{
    Chain, ClassicalChain, DhLink, ParameterId, ParameterNames, ParameterPart, Parameterization, Quantity, Singularity,
    auto_parameterization,
};
use crate::text::Named as _;

fn distance(a: &RigidTransform, b: &RigidTransform) -> f64 {
    (a.to_matrix() - b.to_matrix()).amax()
}

#[test]
fn links_are_read_by_the_modified_convention() {
    let mut random = Random::new(4);
    let chain = random.chain(3);
    let angles = random.angles(3);
    let transform = |rotation: UnitQuaternion<f64>, translation| RigidTransform::new(rotation, translation);
    let link = |link: &DhLink, angle: f64| {
        let x = transform(
            UnitQuaternion::from_axis_angle(&Vector3::x_axis(), link.alpha_rad),
            Vector3::new(link.a_m, 0.0, 0.0),
        );
        let turned = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), angle + link.theta_offset_rad);
        x * transform(turned, Vector3::new(0.0, 0.0, link.d_m))
    };
    let links = chain.links.iter().zip(&angles).map(|(of, angle)| link(of, *angle));
    let expected = links.fold(chain.imu_from_base, |all, next| all * next) * chain.effector_from_camera;
    assert!(distance(&chain.read_as_modified().imu_from_camera(&angles), &expected) < 1e-13);
}

#[test]
fn every_form_has_the_same_forward_kinematics() {
    let mut random = Random::new(1);
    for (name, classical) in all_chains() {
        for parameterization in Parameterization::all() {
            let chain = Chain::from_classical(&classical, parameterization);
            let back = chain.to_classical();
            for _ in 0..5 {
                let angles = random.angles(classical.joint_count());
                let expected = classical.imu_from_camera(&angles);
                assert!(distance(&chain.imu_from_camera(&angles), &expected) < 1e-13, "{name} as {parameterization}");
                assert!(
                    distance(&back.imu_from_camera(&angles), &expected) < 1e-13,
                    "{name} back from {parameterization}"
                );
                let canonical = chain.canonical().imu_from_camera(&angles);
                assert!(distance(&canonical, &expected) < 1e-13, "{name} canonical {parameterization}");
                assert_eq!(chain.linearize(&angles).imu_from_camera, chain.imu_from_camera(&angles));
            }
            for other in Parameterization::all() {
                let angles = random.angles(classical.joint_count());
                let converted = chain.in_parameterization(other);
                assert_eq!(converted.parameterization(), other);
                let error = distance(&converted.imu_from_camera(&angles), &classical.imu_from_camera(&angles));
                assert!(error < 1e-12, "{name} from {parameterization} to {other}: {error}");
            }
        }
    }
}

#[test]
fn a_link_is_the_product_of_its_four_motions() {
    let mut random = Random::new(2);
    for _ in 0..50 {
        let link = random.chain(1).links[0];
        let angle = random.within(3.0);
        let DhLink { theta_offset_rad, d_m, a_m, alpha_rad } = link;
        // Eq. 2, entry by entry.
        let (st, ct) = (angle + theta_offset_rad).sin_cos();
        let (sa, ca) = alpha_rad.sin_cos();
        let printed = nalgebra::Matrix4::new(
            ct,
            -st * ca,
            st * sa,
            a_m * ct, //
            st,
            ct * ca,
            -ct * sa,
            a_m * st, //
            0.0,
            sa,
            ca,
            d_m, //
            0.0,
            0.0,
            0.0,
            1.0,
        );
        assert!((link.transform(angle).to_matrix() - printed).amax() < 1e-15);
    }
}

#[test]
fn frames_end_at_the_camera() {
    let mut random = Random::new(3);
    for joints in 0..5 {
        let chain = random.chain(joints);
        let angles = random.angles(joints);
        let frames = chain.frames_in_imu(&angles);
        assert_eq!(frames.len(), joints + 2);
        assert_eq!(frames[0], chain.imu_from_base);
        assert!(distance(&frames[joints + 1], &chain.imu_from_camera(&angles)) < 1e-15);
        for (index, link) in chain.links.iter().enumerate() {
            let step = frames[index].inverse() * frames[index + 1];
            assert!(distance(&step, &link.transform(angles[index])) < 1e-14);
        }
    }
}

#[test]
fn column_counts_match_the_parameterization() {
    let mut random = Random::new(4);
    for joints in 0..=5 {
        let classical = random.chain(joints);
        for parameterization in Parameterization::all() {
            let chain = Chain::from_classical(&classical, parameterization);
            let columns =
                if parameterization == Parameterization::Classical { 12 + 4 * joints } else { 6 + 4 * joints };
            assert_eq!(chain.joint_count(), joints);
            let thetas = if parameterization == Parameterization::Poe { 0 } else { joints };
            for (chain, columns) in [(chain.clone(), columns), (chain.without_joint_offsets(), columns - thetas)] {
                assert_eq!(chain.dof(), columns, "{parameterization}");
                assert_eq!(chain.parameters().len(), columns);
                assert_eq!(chain.values().len(), columns);
                let linearization = chain.linearize(&random.angles(joints));
                assert_eq!(linearization.by_parameters.ncols(), columns);
                assert_eq!(linearization.by_joints.ncols(), joints);
            }
        }
    }
}

#[test]
fn command_line_names_convert_both_ways() {
    for parameterization in Parameterization::all() {
        assert_eq!(parameterization.name().parse(), Ok(parameterization));
    }
    let error = "minimum".parse::<Parameterization>().unwrap_err();
    assert!(error.to_string().starts_with("unknown parameterization 'minimum': expected one of classical, minimal"));
}

#[test]
fn margins_vanish_at_singularities_and_auto_avoids_them() {
    let expected = [
        ("ideal", "minimal", [1.0, 1.0]),
        ("roll first", "minimal-yx", [0.0, 1.0]),
        ("pitch first", "minimal", [1.0, 1.0]),
        ("body camera", "minimal-swapped", [1.0, 0.0]),
        ("camera on the last axis", "minimal-swapped", [1.0, 0.0]),
    ];
    let chains = special_chains();
    for (name, auto, margins) in expected {
        let classical = &chains.iter().find(|(other, _)| *other == name).unwrap().1;
        let minimal = Chain::from_classical(classical, Parameterization::Minimal);
        let found = minimal.margins();
        let names: Vec<_> =
            found.iter().map(|(singularity, _)| ParameterNames::default().singularity(*singularity)).collect();
        assert_eq!(names, ["base", "end", "L1.alpha", "L2.alpha"], "{name}");
        for (index, margin) in margins.into_iter().chain([1.0, 1.0]).enumerate() {
            assert!((found[index].1 - margin).abs() < 1e-12, "{name}: {found:?}");
        }
        assert_eq!(auto_parameterization(classical).name(), auto, "{name}");
        let switch = minimal.should_switch().map(Parameterization::name);
        assert_eq!(switch, (auto != "minimal").then_some(auto), "{name}");
    }
    let parallel = &chains.iter().find(|(name, _)| *name == "parallel axes").unwrap().1;
    let margins = Chain::from_classical(parallel, Parameterization::Classical).margins();
    assert_eq!(margins[0], (Singularity::ParallelAxes(0), 0.0));
    assert!(Chain::from_classical(parallel, Parameterization::Poe).margins().is_empty());
}

#[test]
fn auto_starts_away_from_singularities_and_switches_late() {
    let mut random = Random::new(5);
    for _ in 0..500 {
        let classical = random.chain(3);
        let auto = auto_parameterization(&classical);
        let chain = Chain::from_classical(&classical, auto);
        assert!(chain.margins().iter().take(2).all(|(_, margin)| *margin > 0.7), "{:?}", chain.margins());
        assert_eq!(chain.should_switch(), None);
    }
    // The camera rotates towards the singularity: the parameterization changes when the margin falls below 0.3,
    // not before.
    let (_, mut classical) = special_chains().remove(0);
    let mut switched_at_rad = None;
    let kept = Chain::from_classical(&classical, Parameterization::Minimal);
    for step in 0..90 {
        let alpha = f64::from(step).to_radians();
        let mut tilted = kept.clone();
        let parameters = tilted.parameters();
        let mut delta = nalgebra::DVector::zeros(parameters.len());
        let twist = ParameterId { part: ParameterPart::Link(2), quantity: Quantity::Alpha };
        delta[parameters.iter().position(|parameter| *parameter == twist).unwrap()] = alpha;
        tilted = tilted.plus(&delta);
        if let Some(other) = tilted.should_switch() {
            assert_eq!(other, Parameterization::MinimalSwapped);
            switched_at_rad.get_or_insert(alpha);
            classical = tilted.to_classical();
        }
    }
    let remaining_rad = FRAC_PI_2 - switched_at_rad.unwrap();
    assert!(remaining_rad.sin() < 0.3 && (remaining_rad + 1.1_f64.to_radians()).sin() > 0.3);
    assert_eq!(auto_parameterization(&classical), Parameterization::MinimalSwapped);
}

#[test]
fn canonical_numbers_do_not_depend_on_how_the_chain_was_written() {
    let mut random = Random::new(6);
    for joints in 1..=4 {
        for _ in 0..20 {
            let classical = random.chain(joints);
            // The same mechanism with other values: moved along its redundant directions and with flipped links.
            let mut other = ClassicalChain::clone(&classical);
            for index in 0..joints - 1 {
                let link = &mut other.links[index];
                link.theta_offset_rad += std::f64::consts::PI;
                link.a_m = -link.a_m;
                link.alpha_rad = -link.alpha_rad;
                other.links[index + 1].theta_offset_rad -= std::f64::consts::PI;
            }
            let shift = DhLink { theta_offset_rad: 0.3, d_m: 0.1, ..DhLink::default() };
            other.imu_from_base = other.imu_from_base * shift.transform(0.0);
            other.links[0].theta_offset_rad -= 0.3;
            other.links[0].d_m -= 0.1;
            for parameterization in
                Parameterization::all().filter(|it| !matches!(it, Parameterization::Classical | Parameterization::Poe))
            {
                let first = Chain::from_classical(&classical, parameterization).canonical();
                let second = Chain::from_classical(&other, parameterization).canonical();
                for (a, b) in first.values().iter().zip(&second.values()) {
                    let revolutions = (a - b) / std::f64::consts::TAU;
                    assert!(
                        (revolutions - revolutions.round()).abs() < 1e-9,
                        "{parameterization}: {first:?} {second:?}"
                    );
                }
            }
        }
    }
}

#[test]
fn values_of_poe_from_one_origin_do_not_depend_on_how_they_were_reached() {
    let mut random = Random::new(11);
    for joints in 1..=5 {
        let origin = Chain::from_classical(&random.chain(joints), Parameterization::Poe);
        let step = DVector::from_fn(origin.dof(), |_, _| random.within(0.3));
        let at_once = origin.plus(&step);
        let values = at_once.values_from(&origin);
        assert!((&values - origin.values() - &step).amax() < 1e-9, "{joints} joints");
        // The same mechanism, written anew: screws along the axes have moved between its blocks.
        let anew = Chain::from_classical(&at_once.to_classical(), Parameterization::Poe);
        assert!((&values - anew.values_from(&origin)).amax() < 1e-9, "{joints} joints");
        assert!(joints == 1 || (anew.values() - at_once.values()).amax() > 1e-3, "{joints} joints");
        let minimal = origin.in_parameterization(Parameterization::Minimal);
        assert_eq!(minimal.values_from(&minimal), minimal.values());
    }
}
