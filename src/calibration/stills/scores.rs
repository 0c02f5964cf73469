//! Errors in pixels, summed up over sets and collected per set.

use super::observed::ObservedSet;
use super::outcome::{CameraFloor, PixelStatistics, ScoredChain, SetReport, StillsScore, ViewReport};
use super::pixels::{SetErrors, ViewErrors};
use crate::sensors::Stills;

/// Floors of the gimbal camera and of each rigid camera.
pub(super) fn floors(stills: &Stills, sets: &[ObservedSet]) -> Vec<CameraFloor> {
    let gimbal: Vec<(f64, usize)> = sets.iter().map(|set| (set.gimbal.mean_px, set.gimbal.left_out)).collect();
    let rigid = stills.rigid_cameras.iter().enumerate().map(|(index, camera)| {
        let views = sets.iter().flat_map(|set| &set.rigid).filter(|(of, _)| *of == index);
        (camera.name.clone(), views.map(|(_, view)| (view.mean_px, view.left_out)).collect())
    });
    let all: Vec<(String, Vec<(f64, usize)>)> =
        std::iter::once((stills.gimbal_camera.name.clone(), gimbal)).chain(rigid).collect();
    let floor = |(camera, views): (String, Vec<(f64, usize)>)| {
        let lengths: Vec<f64> = views.iter().map(|view| view.0).collect();
        let points_left_out = views.iter().map(|view| view.1).sum();
        Some(CameraFloor { camera, floor: PixelStatistics::of(&lengths)?, points_left_out })
    };
    all.into_iter().filter_map(floor).collect()
}

/// Scores of a chain in every rigid camera; `wrong` marks the sets whose readings are wrong.
pub(super) fn scores(
    stills: &Stills,
    chain: ScoredChain,
    errors: &[Option<&SetErrors>],
    wrong: &[bool],
) -> Vec<StillsScore> {
    let score = |(index, camera): (usize, &crate::sensors::StillCamera)| {
        let values = |all: bool, of: fn(&ViewErrors) -> Option<f64>| -> Vec<f64> {
            let used = errors.iter().zip(wrong).filter(|(_, wrong)| all || !**wrong);
            let views = used.filter_map(|(errors, _)| *errors).flat_map(|errors| &errors.views);
            views.filter(|view| view.camera == index).filter_map(of).collect()
        };
        StillsScore {
            chain,
            camera: camera.name.clone(),
            as_read: PixelStatistics::of(&values(false, |view| view.as_read_px)),
            estimated: PixelStatistics::of(&values(false, |view| view.estimated_px)),
            as_read_all: PixelStatistics::of(&values(true, |view| view.as_read_px)),
        }
    };
    stills.rigid_cameras.iter().enumerate().map(score).collect()
}

/// Errors of one set by the chains that were evaluated.
pub(super) struct SetEvaluation<'a> {
    pub(super) initial: &'a SetErrors,
    /// By the calibrated or given chain.
    pub(super) chain: &'a SetErrors,
    pub(super) hold_out: Option<&'a SetErrors>,
}

/// Report of a set with angles in rad.
pub(super) fn set_report(
    stills: &Stills,
    set: &ObservedSet,
    wrong: bool,
    [corrections_rad, sigmas_rad]: [&[f64]; 2],
    evaluation: &SetEvaluation<'_>,
) -> SetReport {
    let degrees = |angles: &[f64]| angles.iter().map(|angle| angle.to_degrees()).collect();
    let views = set.rigid.iter().map(|(camera, view)| {
        let of = |errors: Option<&SetErrors>| errors?.views.iter().find(|view| view.camera == *camera).copied();
        let [initial, chain, held] = [Some(evaluation.initial), Some(evaluation.chain), evaluation.hold_out].map(of);
        ViewReport {
            camera: stills.rigid_cameras[*camera].name.clone(),
            floor_px: view.mean_px,
            initial_px: initial.and_then(|view| view.as_read_px),
            as_read_px: chain.and_then(|view| view.as_read_px),
            estimated_px: chain.and_then(|view| view.estimated_px),
            hold_out_as_read_px: held.and_then(|view| view.as_read_px),
            hold_out_estimated_px: held.and_then(|view| view.estimated_px),
        }
    });
    SetReport {
        id: set.id,
        station: set.station,
        wrong,
        readings_deg: degrees(&set.readings_rad),
        corrections_deg: degrees(corrections_rad),
        sigmas_deg: degrees(sigmas_rad),
        views: views.collect(),
    }
}
