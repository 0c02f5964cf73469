//! Fragments of an MP4 file (`moof`): samples of each track that are not in the tables of `moov`.

use super::boxes::{child, children, u32_at, u64_at};
use super::track::{MovieTrack, Sample};

/// Defaults of a track's samples (box `trex`, replaced by the defaults in `tfhd`).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Defaults {
    track: u32,
    duration: u32,
    size: u32,
}

/// Fragments of a movie, read one after the other.
#[derive(Clone, Debug)]
pub(super) struct Fragments {
    defaults: Vec<Defaults>,
    /// Decoding time behind the last sample of each track of `tracks`, in units of the track.
    decoded: Vec<u64>,
    /// Largest number of samples of all fragments.
    max_samples: u64,
    samples: u64,
    /// Number of samples beyond that, or in fragments that cannot be read.
    pub(super) undescribed: u64,
}

impl Fragments {
    /// `None` for a `moov` box without `mvex`, which a fragmented movie has.
    pub(super) fn new(moov: &[u8], tracks: &[MovieTrack<'_>], max_samples: u64) -> Option<Self> {
        let extends = child(moov, b"mvex")?;
        let defaults = children(extends).filter(|(kind, _)| kind == b"trex").filter_map(|(_, trex)| {
            // Version and flags, track, sample description, then the defaults.
            Some(Defaults { track: u32_at(trex, 4)?, duration: u32_at(trex, 12)?, size: u32_at(trex, 16)? })
        });
        let decoded = tracks.iter().map(|track| track.end).collect();
        Some(Self { defaults: defaults.collect(), decoded, max_samples, samples: 0, undescribed: 0 })
    }

    /// Adds the samples of a `moof` box whose header begins at a byte of the file.
    pub(super) fn add(&mut self, moof: &[u8], moof_start: u64, tracks: &mut [MovieTrack<'_>]) {
        let mut behind = moof_start;
        for (_, traf) in children(moof).filter(|(kind, _)| kind == b"traf") {
            match self.add_track(traf, [moof_start, behind], tracks) {
                Some(end) => behind = end,
                None => self.undescribed += 1,
            }
        }
    }

    /// Adds the samples of a `traf` box; returns the byte behind its data, `None` if the box is damaged.
    ///
    /// Data begin relative to the fragment or behind the data of the track before (`[moof_start, behind]`).
    fn add_track(&mut self, traf: &[u8], [moof_start, behind]: [u64; 2], tracks: &mut [MovieTrack<'_>]) -> Option<u64> {
        let header = TrackHeader::read(child(traf, b"tfhd")?, &self.defaults)?;
        let place = tracks.iter().position(|track| track.id == header.defaults.track);
        let base = header.base.unwrap_or(if header.is_relative { moof_start } else { behind });
        if let (Some(place), Some(time)) = (place, child(traf, b"tfdt")) {
            self.decoded[place] = if time.first() == Some(&1) { u64_at(time, 4)? } else { u64::from(u32_at(time, 4)?) };
        }
        let mut at = base;
        for (_, trun) in children(traf).filter(|(kind, _)| kind == b"trun") {
            let mut run = TrackRun::read(trun)?;
            if let Some(offset) = run.offset {
                at = base.checked_add_signed(i64::from(offset))?;
            }
            while let Some(entry) = run.next(&header.defaults) {
                if self.samples >= self.max_samples {
                    self.undescribed = self.undescribed.saturating_add(u64::from(run.left) + 1);
                    return Some(at);
                }
                self.samples += 1;
                if let Some(place) = place {
                    self.push(&mut tracks[place], place, entry, at)?;
                }
                at = at.checked_add(u64::from(entry.size))?;
            }
        }
        Some(at)
    }

    fn push(&mut self, track: &mut MovieTrack<'_>, place: usize, entry: FragmentSample, start: u64) -> Option<()> {
        let decoded = i64::try_from(self.decoded[place]).ok()?;
        let end = decoded.checked_add(i64::from(entry.duration))?;
        let decoded_ns = track.clock.in_ns(decoded)?;
        let presented_ns = track.clock.in_ns(decoded.checked_add(i64::from(entry.delay))?)?;
        let duration_ns = track.clock.in_ns(end)?.saturating_sub(decoded_ns);
        track.samples.push(Sample { start, length: u64::from(entry.size), decoded_ns, presented_ns, duration_ns });
        self.decoded[place] = end.cast_unsigned();
        Some(())
    }
}

/// Fields of a `tfhd` box.
struct TrackHeader {
    defaults: Defaults,
    /// Start of the data in the file.
    base: Option<u64>,
    /// True if data begin relative to the fragment.
    is_relative: bool,
}

impl TrackHeader {
    fn read(tfhd: &[u8], defaults: &[Defaults]) -> Option<Self> {
        let flags = u32_at(tfhd, 0)?;
        let track = u32_at(tfhd, 4)?;
        let defaults = defaults.iter().find(|defaults| defaults.track == track);
        let mut defaults = defaults.copied().unwrap_or_else(|| Defaults { track, ..Defaults::default() });
        let mut at = 8;
        let mut base = None;
        if flags & 0x1 != 0 {
            base = Some(u64_at(tfhd, at)?);
            at += 8;
        }
        let mut field = |bit: u32| {
            let has = flags & bit != 0;
            at += if has { 4 } else { 0 };
            if has { u32_at(tfhd, at - 4).map(Some) } else { Some(None) }
        };
        // Sample description, then duration and size.
        field(0x2)?;
        defaults.duration = field(0x8)?.unwrap_or(defaults.duration);
        defaults.size = field(0x10)?.unwrap_or(defaults.size);
        Some(Self { defaults, base, is_relative: flags & 0x02_0000 != 0 })
    }
}

/// Sample of a run; duration and delay from decoding to presentation in units of the track.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct FragmentSample {
    duration: u32,
    size: u32,
    delay: i32,
}

/// Samples of a `trun` box.
struct TrackRun<'a> {
    flags: u32,
    /// Start of the data relative to the base.
    offset: Option<i32>,
    /// Number of samples that are not read yet.
    left: u32,
    rest: &'a [u8],
}

impl<'a> TrackRun<'a> {
    fn read(trun: &'a [u8]) -> Option<Self> {
        let (flags, left) = (u32_at(trun, 0)?, u32_at(trun, 4)?);
        let mut at = 8;
        let mut offset = None;
        if flags & 0x1 != 0 {
            offset = Some(u32_at(trun, at)?.cast_signed());
            at += 4;
        }
        // Flags of the first sample.
        at += if flags & 0x4 != 0 { 4 } else { 0 };
        Some(Self { flags, offset, left, rest: trun.get(at..)? })
    }

    /// Next sample; `None` at the end of the run, or of the box.
    fn next(&mut self, defaults: &Defaults) -> Option<FragmentSample> {
        self.left = self.left.checked_sub(1)?;
        let mut field = |bit: u32| {
            if self.flags & bit == 0 {
                return Some(None);
            }
            let value = u32_at(self.rest, 0)?;
            self.rest = &self.rest[4..];
            Some(Some(value))
        };
        let duration = field(0x100)?.unwrap_or(defaults.duration);
        let size = field(0x200)?.unwrap_or(defaults.size);
        field(0x400)?;
        // Signed in version 1; in version 0 below 2³¹ in practice.
        let delay = field(0x800)?.unwrap_or(0).cast_signed();
        Some(FragmentSample { duration, size, delay })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_of_a_run_follow_its_flags() {
        let words = |words: &[u32]| words.iter().flat_map(|word| word.to_be_bytes()).collect::<Vec<u8>>();
        let defaults = Defaults { track: 1, duration: 40, size: 9 };
        let bytes = words(&[0xA01, 2, 100, 7, 5, 8, 6]);
        let mut run = TrackRun::read(&bytes).unwrap();
        assert_eq!(run.offset, Some(100));
        assert_eq!(run.next(&defaults), Some(FragmentSample { duration: 40, size: 7, delay: 5 }));
        assert_eq!(run.next(&defaults), Some(FragmentSample { duration: 40, size: 8, delay: 6 }));
        assert_eq!(run.next(&defaults), None);
        let bytes = words(&[0x100, 3, 20]);
        let mut run = TrackRun::read(&bytes).unwrap();
        assert_eq!(run.next(&defaults), Some(FragmentSample { duration: 20, size: 9, delay: 0 }));
        assert_eq!(run.next(&defaults), None, "the box ends before the run");
        assert!(TrackRun::read(&words(&[0x5, 1])).is_none());
    }

    #[test]
    fn defaults_of_a_fragment_replace_those_of_the_movie() {
        let words = |words: &[u32]| words.iter().flat_map(|word| word.to_be_bytes()).collect::<Vec<u8>>();
        let movie = [Defaults { track: 2, duration: 40, size: 9 }];
        let header = TrackHeader::read(&words(&[0x02_000A, 2, 1, 50]), &movie).unwrap();
        assert_eq!((header.defaults, header.is_relative), (Defaults { track: 2, duration: 50, size: 9 }, true));
        let header = TrackHeader::read(&words(&[0x11, 3, 0, 1000, 12]), &movie).unwrap();
        assert_eq!((header.base, header.defaults.size, header.defaults.duration), (Some(1000), 12, 0));
        assert!(TrackHeader::read(&words(&[0x11, 3, 0]), &movie).is_none());
    }
}
