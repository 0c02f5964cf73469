//! Text of a rig file as a located document, its syntax errors, and lines that have lost their indentation, as by
//! copying from a web page.

use std::io::Read as _;
use std::path::{Path, PathBuf};

use serde_saphyr::Error;

use super::fields::Field;
use super::keys;
use crate::files::FileError;
use crate::files::located::Located;
use crate::files::yaml::without_opencv_head;
use crate::text::{shortened, without_bom};

/// Largest rig file in bytes; the rig of 16 links and 16 cameras takes 16 kB.
const MAX_RIG_BYTES: u64 = 1 << 20;

/// Parsed rig file with its text.
#[derive(Clone, Debug)]
pub(crate) struct Document {
    pub(crate) value: Located,
    pub(crate) file: PathBuf,
}

impl Document {
    /// Reads and parses a file.
    pub(crate) fn read(path: &Path) -> Result<Self, FileError> {
        let failed = |source| FileError::Io { action: "read the rig", source, path: path.to_owned() };
        let file = std::fs::File::open(path).map_err(failed)?;
        let mut bytes = Vec::new();
        file.take(MAX_RIG_BYTES + 1).read_to_end(&mut bytes).map_err(failed)?;
        Self::from_bytes(bytes, path)
    }

    /// Parses the bytes of a file or an attachment.
    pub(crate) fn from_bytes(bytes: Vec<u8>, file: &Path) -> Result<Self, FileError> {
        let syntax = |problem: String| FileError::RigSyntax { problem, path: file.to_owned() };
        if bytes.len() as u64 > MAX_RIG_BYTES {
            return Err(syntax(format!("more than {MAX_RIG_BYTES} bytes, expected a rig of some kilobytes")));
        }
        let text = String::from_utf8(bytes).map_err(|error| {
            let valid = error.utf8_error().valid_up_to();
            let line = error.as_bytes()[..valid].split(|byte| *byte == b'\n').count();
            syntax(format!("line {line}: byte {valid} is not UTF-8, expected a text file"))
        })?;
        Self::parse(without_bom(&text), file)
    }

    pub(crate) fn parse(text: &str, file: &Path) -> Result<Self, FileError> {
        let text = &without_opencv_head(text);
        check_indentation(text, file)?;
        match Located::of_yaml(text) {
            Ok(value) => Ok(Self { value, file: file.to_owned() }),
            Err(error) => Err(FileError::RigSyntax { problem: syntax_problem(&error, text), path: file.to_owned() }),
        }
    }

    pub(crate) fn root(&self) -> Field<'_> {
        Field::root(&self.value, &self.file)
    }
}

/// Describes a syntax error by line, field, found and expected text.
fn syntax_problem(error: &Error, text: &str) -> String {
    let location = error.location().filter(|location| location.line() > 0);
    let Some(location) = location else { return "expected a mapping with rig_version, imu0, cam0, …".to_owned() };
    // Errors at the end of the text are reported after the last line.
    let count = text.lines().count() as u64;
    let line = location.line().clamp(1, count.max(1));
    let unclosed = |open, close| line_of_unclosed(text, open, close);
    let (list, mapping) = (unclosed('[', ']'), unclosed('{', '}'));
    // The parser stops after the line that lacks a bracket.
    let line = list.or(mapping).map_or(line, |unclosed| unclosed.min(line));
    let found = text.lines().nth(line as usize - 1).unwrap_or_default();
    let field = field_at(text, line as usize - 1).map(|field| format!(", in {field}")).unwrap_or_default();
    let what = match error.without_snippet() {
        Error::DuplicateMappingKey { .. } => "the key is repeated, expected each key once",
        Error::MultipleDocuments { .. } => "a second document ('---'), expected one",
        Error::Eof { .. } => "the text ends here, expected a mapping with rig_version, imu0, cam0, …",
        Error::Budget { .. } => "too many values or aliases, expected a rig of some kilobytes",
        _ if found.trim_start_matches(' ').starts_with('\t') => "a tab, expected spaces before a key",
        _ if list.is_some() => "a list '[' without its ']', expected [value, value, …]",
        _ if mapping.is_some() => "a mapping '{' without its '}', expected {key: value, …}",
        _ if unclosed_quote(found) => "a quote that is not closed",
        _ if !found.contains(':') && !found.trim_start().starts_with('-') => "no 'key: value', expected one",
        _ => "expected 'key: value', with the keys of one mapping indented by the same number of spaces",
    };
    format!("line {line}{field}: '{}': {what}", shortened(found.trim(), 60))
}

/// Line of the last unclosed bracket, comments aside.
fn line_of_unclosed(text: &str, open: char, close: char) -> Option<u64> {
    let mut lines: Vec<u64> = Vec::new();
    for (number, line) in (1..).zip(text.lines()) {
        for letter in line.split(" #").next().unwrap_or_default().chars() {
            if letter == open {
                lines.push(number);
            } else if letter == close {
                lines.pop();
            }
        }
    }
    lines.pop()
}

fn unclosed_quote(line: &str) -> bool {
    ['"', '\''].into_iter().any(|quote| line.matches(quote).count() % 2 == 1)
}

/// Path of the field of a line, by the indentation of the keys above it.
fn field_at(text: &str, line: usize) -> Option<String> {
    let lines: Vec<&str> = text.lines().take(line + 1).collect();
    let mut keys: Vec<&str> = Vec::new();
    let mut depth = usize::MAX;
    for line in lines.iter().rev() {
        let content = line.trim_start_matches([' ', '-']);
        let indentation = line.len() - content.len();
        let Some((key, _)) = content.split_once(':') else { continue };
        let is_key = !key.is_empty() && key.chars().all(|letter| letter.is_ascii_alphanumeric() || letter == '_');
        if is_key && indentation < depth {
            depth = indentation;
            keys.push(key);
        }
    }
    keys.reverse();
    (!keys.is_empty()).then(|| keys.join("."))
}

/// Returns an error if a key of a camera, an IMU or a gimbal is not indented below it, so that it does not belong to
/// it. `text` is the text of the file.
fn check_indentation(text: &str, file: &Path) -> Result<(), FileError> {
    let mut mapping: Option<&str> = None;
    // Number of brackets that are open at the start of a line.
    let mut open = 0_usize;
    for (number, line) in (1..).zip(text.lines()) {
        let content = line.split(" #").next().unwrap_or_default().trim_end();
        let is_inside = open > 0;
        for letter in content.chars() {
            match letter {
                '[' | '{' => open += 1,
                ']' | '}' => open = open.saturating_sub(1),
                _ => {}
            }
        }
        if is_inside || !content.starts_with(|letter: char| letter.is_ascii_alphabetic()) {
            continue;
        }
        let Some((key, value)) = content.split_once(':') else { continue };
        let key = key.trim_end();
        if keys::is_of_root(key) {
            mapping = value.trim().is_empty().then_some(key);
        } else if let Some(mapping) = mapping.filter(|mapping| keys::is_of_mapping(key, mapping)) {
            return Err(FileError::Rig {
                field: mapping.to_owned(),
                problem: format!(
                    "the lines under {mapping}: are not indented (line {number}: '{key}'), so that they do not belong to it; \
                     indent all of them by the same number of spaces"
                ),
                path: file.to_owned(),
            });
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn document(text: &str) -> Document {
        Document::parse(text, Path::new("some.rig.yaml")).unwrap()
    }

    #[test]
    fn fields_have_lines() {
        let document = document(
            "rig_version: 1\nimu0: {rostopic: /imu,\n       update_rate: 200}\ngimbal:\n  links:\n  - joint: yaw\n    d: 1\n  \
             - joint: roll\n    alpha: 2\n",
        );
        let root = document.root();
        let links = root.field("gimbal").field("links").list("links").unwrap();
        let check = |field: &Field<'_>, expected: &str| {
            let error = field.error("wrong").to_string();
            assert_eq!(error, format!("{expected}: some.rig.yaml"));
        };
        check(&root.field("rig_version"), "rig_version: wrong, line 1");
        check(&root.field("imu0").field("update_rate"), "imu0.update_rate: wrong, line 3");
        check(&links[0].field("d"), "gimbal.links[0].d: wrong, line 7");
        check(&links[1].field("alpha"), "gimbal.links[1].alpha: wrong, line 9");
        // A missing field is reported at its mapping.
        check(&links[1].field("limits"), "gimbal.links[1].limits: wrong, line 8");
        check(&root.field("imu0").field("frame_id"), "imu0.frame_id: wrong, line 2");
        check(&root.field("cam0"), "cam0: wrong");
    }

    #[test]
    fn syntax_errors_name_line_field_and_expectation() {
        let check = |text: &str, expected: &str| {
            let error = Document::parse(text, Path::new("some.rig.yaml")).unwrap_err().to_string();
            assert_eq!(error, format!("the rig is not valid YAML: {expected}: some.rig.yaml"), "{text}");
        };
        check(
            "rig_version: 1\ncam0:\n  intrinsics: [1, 2\n",
            "line 3, in cam0.intrinsics: 'intrinsics: [1, 2': a list '[' without its ']', expected [value, value, …]",
        );
        check(
            "cam0:\n  intrinsics: [1, 2\n  distortion_model: none\n  resolution: [3, 4]\n",
            "line 2, in cam0.intrinsics: 'intrinsics: [1, 2': a list '[' without its ']', expected [value, value, …]",
        );
        check(
            "imu0:\n  rostopic: /imu\n  rostopic: /imu\n",
            "line 3, in imu0.rostopic: 'rostopic: /imu': the key is repeated, expected each key once",
        );
    }

    fn problem(text: &str) -> Option<String> {
        check_indentation(text, Path::new("some.yaml")).err().map(|error| error.to_string())
    }

    #[test]
    fn lost_indentation_is_reported_with_its_line() {
        let expected = "cam0: the lines under cam0: are not indented (line 2: 'T_cam_imu'), so that they do not belong to it; \
                        indent all of them by the same number of spaces: some.yaml";
        let text =
            "cam0:\nT_cam_imu:\n- [0.0, 1.0]\n- [1.0, 0.0]\ncamera_model: pinhole\ncam1:\nT_cam_imu:\n- [1, 0]\n";
        assert_eq!(problem(text).unwrap(), expected);
        assert_eq!(problem(&text.replace('\n', "\r\n")).unwrap(), expected);
        let last = problem("imu0:\n  rostopic: /imu\nupdate_rate: 200.0\n").unwrap();
        assert!(last.starts_with("imu0: the lines under imu0: are not indented (line 3: 'update_rate')"), "{last}");
        let gimbal = problem("rig_version: 1\ngimbal: # the chain\nrostopic: /joints\n").unwrap();
        assert!(gimbal.contains("line 3: 'rostopic'"), "{gimbal}");
    }

    #[test]
    fn indented_and_flat_files_are_left_alone() {
        for text in [
            "cam0:\n  T_cam_imu:\n  - [0.0, 1.0]\n  rostopic: /cam\nimu0: {rostopic: /imu,\nupdate_rate: 200.0}\n",
            "rostopic: /imu\nupdate_rate: 200.0\n",
            "gimbal:\nground_truth: {rostopic: /truth}\nassumed:\n",
            "cam0:\n  T_cam_imu: [[1, 0],\n[0, 1]]\n",
            "",
        ] {
            assert_eq!(problem(text), None, "{text}");
        }
    }
}
