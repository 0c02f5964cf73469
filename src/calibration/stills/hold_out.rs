//! Hold-out: calibrations without some stations, evaluated on the sets of these stations.

use rayon::prelude::*;

use super::fit::{AngleModel, Start, StillsFit};
use super::observed::ObservedSet;
use super::pixels::{SetErrors, set_errors};
use crate::sensors::Stills;

/// Fold of each set: whole stations, the largest first, each into the fold with the fewest sets so far.
pub(super) fn folds(sets: &[ObservedSet], count: usize) -> Vec<usize> {
    let mut stations: Vec<(u64, usize)> = Vec::new();
    for set in sets {
        match stations.iter_mut().find(|(station, _)| *station == set.station) {
            Some((_, size)) => *size += 1,
            None => stations.push((set.station, 1)),
        }
    }
    let count = count.min(stations.len());
    if count < 2 {
        return Vec::new();
    }
    stations.sort_by_key(|(station, size)| (std::cmp::Reverse(*size), *station));
    let mut sizes = vec![0; count];
    let mut fold_of: Vec<(u64, usize)> = Vec::new();
    for (station, size) in stations {
        let fold = (0..count).min_by_key(|fold| sizes[*fold]).unwrap_or(0);
        sizes[fold] += size;
        fold_of.push((station, fold));
    }
    let fold = |set: &ObservedSet| fold_of.iter().find(|(station, _)| *station == set.station).map_or(0, |it| it.1);
    sets.iter().map(fold).collect()
}

/// Errors of each set by the chain of the other folds; `None` where that chain could not be estimated, and for all sets if
/// there are fewer than two stations.
pub(super) fn hold_out(
    stills: &Stills,
    sets: &[ObservedSet],
    start: &Start,
    model: AngleModel,
    count: usize,
) -> Vec<Option<SetErrors>> {
    let folds = folds(sets, count);
    let Some(last) = folds.iter().max() else { return vec![None; sets.len()] };
    let starts: Vec<Option<Start>> = (0..=*last)
        .into_par_iter()
        .map(|fold| {
            let others = sets.iter().zip(&folds).filter(|(_, of)| **of != fold).map(|(set, _)| set);
            Some(StillsFit::new(&others.collect::<Vec<_>>(), start, model)?.start())
        })
        .collect();
    let evaluate = |(set, fold): (&ObservedSet, &usize)| {
        let chain = starts[*fold].as_ref()?;
        Some(set_errors(set, &stills.rigid_cameras, &chain.chain, &chain.further))
    };
    sets.par_iter().zip(&folds).map(evaluate).collect()
}
