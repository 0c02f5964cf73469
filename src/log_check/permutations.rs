//! Orders in which a driver can write the parts of a message.

/// All permutations of the numbers below `count`, which is at most three, the given order first.
pub(super) fn permutations(count: usize) -> Vec<Vec<usize>> {
    let mut all: Vec<Vec<usize>> = vec![Vec::new()];
    for _ in 0..count {
        let longer = |before: &Vec<usize>| {
            let rest = (0..count).filter(|next| !before.contains(next)).collect::<Vec<_>>();
            rest.into_iter().map(|next| before.iter().copied().chain([next]).collect()).collect::<Vec<Vec<usize>>>()
        };
        all = all.iter().flat_map(longer).collect();
    }
    all
}
