use std::fs::File;
use std::io::{self, Read as _, Seek as _, SeekFrom, Write as _};
use std::ops::Range;

/// File without a name in the folder for temporary files, for data that would take too much memory; its space is free
/// again when it is dropped, also if the process is killed.
#[derive(Debug)]
pub(crate) struct ScratchFile {
    file: File,
    length: u64,
}

impl ScratchFile {
    pub(crate) fn unnamed() -> io::Result<Self> {
        Ok(Self { file: tempfile::tempfile()?, length: 0 })
    }

    /// Writes bytes at the end; returns their place.
    pub(crate) fn append(&mut self, bytes: &[u8]) -> io::Result<Range<u64>> {
        self.file.seek(SeekFrom::Start(self.length))?;
        self.file.write_all(bytes)?;
        let place = self.length..self.length + bytes.len() as u64;
        self.length = place.end;
        Ok(place)
    }

    /// Bytes at a place.
    pub(crate) fn read(&mut self, place: &Range<u64>) -> io::Result<Vec<u8>> {
        self.file.seek(SeekFrom::Start(place.start))?;
        let mut bytes = vec![0; usize::try_from(place.end - place.start).map_err(io::Error::other)?];
        self.file.read_exact(&mut bytes)?;
        Ok(bytes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_part_is_read_at_its_place() {
        let mut file = ScratchFile::unnamed().unwrap();
        let parts: Vec<Vec<u8>> = (1..50_u8).map(|number| vec![number; usize::from(number) * 7]).collect();
        let places: Vec<_> = parts.iter().map(|part| file.append(part).unwrap()).collect();
        for (part, place) in parts.iter().zip(&places).rev() {
            assert_eq!(file.read(place).unwrap(), *part);
        }
        assert_eq!(file.append(b"more").unwrap().start, places[48].end);
        assert!(file.read(&(0..1_000_000)).is_err());
    }
}
