//! Readers of external data with changed inputs: the functions of the fuzz targets, called with seeds whose bytes were
//! changed at random, the same at each run. `.ci/fuzz` searches for hours, with counters of covered code.

use std::fs;
use std::panic::catch_unwind;
use std::path::{Path, PathBuf};

use dcvins::geometry::SplitMix64;

#[expect(unreachable_pub, clippy::duplicate_mod, reason = "the crate of the fuzz targets is a module here")]
#[path = "../../fuzz/src/lib.rs"]
mod targets;

/// Largest number of changes of an input.
const MOST_CHANGES: usize = 6;
/// Longest range of bytes that a change repeats, removes or takes from another seed.
const LONGEST_RANGE: usize = 64;

/// Random number below a limit.
fn below(random: &mut SplitMix64, limit: usize) -> usize {
    (random.next_u64() % limit.max(1) as u64) as usize
}

/// Range of an input of some length, at most [`LONGEST_RANGE`] long.
fn range(random: &mut SplitMix64, length: usize) -> std::ops::Range<usize> {
    let start = below(random, length);
    start..length.min(start + 1 + below(random, LONGEST_RANGE))
}

/// Changes an input: a bit, a byte, a number, or a range that is removed, repeated, or taken from another input.
fn change(input: &mut Vec<u8>, other: &[u8], random: &mut SplitMix64) {
    const NUMBERS: [u64; 8] = [0, 1, 0x7f, 0xff, 0x7fff, 0x7fff_ffff, u64::MAX >> 1, u64::MAX];
    if input.is_empty() {
        input.extend(random.next_u64().to_le_bytes());
        return;
    }
    let at = below(random, input.len());
    match random.next_u64() % 8 {
        0 => input[at] ^= 1 << (random.next_u64() % 8),
        1 => input[at] = random.next_u64() as u8,
        2 => input[at] = input[at].wrapping_add_signed((random.next_u64() % 33) as i8 - 16),
        3 => {
            let number = NUMBERS[below(random, NUMBERS.len())];
            let width = [1, 2, 4, 8][below(random, 4)].min(input.len() - at);
            let (little, big) = (number.to_le_bytes(), number.to_be_bytes());
            let bytes = if random.next_u64().is_multiple_of(2) { &little[..width] } else { &big[big.len() - width..] };
            input[at..at + width].copy_from_slice(bytes);
        }
        4 => drop(input.drain(range(random, input.len()))),
        5 => {
            let repeated = input[range(random, input.len())].to_vec();
            input.splice(at..at, repeated).for_each(drop);
        }
        6 if !other.is_empty() => {
            let taken = other[range(random, other.len())].to_vec();
            let end = input.len().min(at + taken.len());
            input.splice(at..end, taken).for_each(drop);
        }
        _ => input.truncate(at),
    }
}

/// Passes the seeds of a target to its function, and then inputs that are made by changing them.
fn fuzz(name: &str, function: fn(&[u8]), inputs: usize) {
    let corpus = tempfile::tempdir().expect("a folder can be made");
    targets::seeds::write(corpus.path()).expect("the seeds can be written");
    let files = fs::read_dir(corpus.path().join(name)).expect("the target has seeds");
    let mut files: Vec<PathBuf> = files.map(|entry| entry.expect("the entry can be read").path()).collect();
    files.sort();
    let seeds: Vec<Vec<u8>> = files.iter().map(|path| fs::read(path).expect("the seed can be read")).collect();
    assert!(!seeds.is_empty(), "{name} has no seeds");
    let mut random = SplitMix64::new(7);
    for number in 0..inputs {
        let mut input = seeds[number % seeds.len()].clone();
        if number >= seeds.len() {
            let other = &seeds[below(&mut random, seeds.len())];
            for _ in 0..=below(&mut random, MOST_CHANGES) {
                change(&mut input, other, &mut random);
            }
        }
        if catch_unwind(|| function(&input)).is_err() {
            let kept = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("{name}-{number}"));
            fs::write(&kept, &input).expect("the input can be kept");
            panic!("{name}: input {number} panics, it is kept as {}", kept.display());
        }
    }
}

macro_rules! changed_inputs {
    ($($target:ident: $inputs:literal,)*) => {$(
        #[test]
        fn $target() {
            fuzz(stringify!($target), targets::$target, $inputs);
        }
    )*};
}

// As many inputs as take about a second.
changed_inputs! {
    bag: 1500,
    condition: 10_000,
    database: 1000,
    dataflash: 2000,
    euroc: 600,
    gpmf: 400,
    log: 40,
    message: 800,
    movie: 1500,
    rig: 3000,
    session: 10_000,
    stills: 5000,
    tlog: 1200,
    trajectory: 5000,
    ulog: 1200,
    urdf: 5000,
    video: 250,
}
