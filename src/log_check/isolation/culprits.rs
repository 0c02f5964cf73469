//! Sources that are wrong, from the pairs that agree and disagree.

use super::source::Source;

/// Pair of sources and whether they disagree.
pub(super) type Verdict = ([Source; 2], bool);

/// Smallest sets of sources without which all others agree; of several, those with the fewest agreements of their own. Empty
/// if all agree.
pub(super) fn culprits(pairs: &[Verdict]) -> Vec<Vec<Source>> {
    let mut sources: Vec<&Source> = pairs.iter().flat_map(|(both, _)| both).collect();
    sources.sort();
    sources.dedup();
    let has =
        |set: usize, source: &Source| sources.iter().position(|it| *it == source).is_some_and(|it| set >> it & 1 == 1);
    let explains =
        |set: &usize| pairs.iter().all(|([one, other], disagree)| !disagree || has(*set, one) || has(*set, other));
    let agreements = |set: usize| {
        pairs.iter().filter(|([one, other], disagree)| !disagree && (has(set, one) || has(set, other))).count()
    };
    let sets = (0..1_usize << sources.len()).filter(explains);
    let ranked: Vec<((u32, usize), usize)> = sets.map(|set| ((set.count_ones(), agreements(set)), set)).collect();
    let Some(best) = ranked.iter().map(|(rank, _)| *rank).min().filter(|(size, _)| *size > 0) else {
        return Vec::new();
    };
    let of_set =
        |set: usize| sources.iter().filter(|source| has(set, source)).map(|source| (*source).clone()).collect();
    ranked.into_iter().filter(|(rank, _)| *rank == best).map(|(_, set)| of_set(set)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn images() -> Source {
        Source::Images { camera_key: "cam0".to_owned(), with_joints: false }
    }

    #[test]
    fn a_source_that_disagrees_with_consistent_ones_is_isolated() {
        let (gyroscope, truth) = (Source::Gyroscope, Source::GroundTruth);
        let pair = |one: &Source, other: &Source, disagree| ([one.clone(), other.clone()], disagree);
        let all = |first, second, third| {
            [pair(&gyroscope, &images(), first), pair(&gyroscope, &truth, second), pair(&images(), &truth, third)]
        };
        assert_eq!(culprits(&all(false, false, false)), Vec::<Vec<Source>>::new());
        assert_eq!(culprits(&all(true, true, false)), [[gyroscope.clone()]]);
        assert_eq!(culprits(&all(true, false, true)), [[images()]]);
        // With two sources, or if a noisy third one agrees with both, either may be wrong.
        assert_eq!(culprits(&all(true, true, false)[..1]), [[gyroscope.clone()], [images()]]);
        assert_eq!(culprits(&all(false, true, false)), [[gyroscope.clone()], [truth.clone()]]);
        assert_eq!(culprits(&all(true, true, true)).len(), 3);
        // An agreement of one of two speaks for it.
        assert_eq!(culprits(&[pair(&gyroscope, &truth, true), pair(&images(), &truth, false)]), [[gyroscope]]);
    }
}
