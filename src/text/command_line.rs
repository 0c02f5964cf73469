//! Command lines as they can be typed into a shell.

/// The words of a command, quoted where a shell needs it; the first one is the program.
pub fn command_line(words: impl IntoIterator<Item = String>) -> String {
    words.into_iter().map(quoted).collect::<Vec<_>>().join(" ")
}

fn quoted(word: String) -> String {
    let plain = |letter: char| letter.is_alphanumeric() || "/._-:=,+".contains(letter);
    if !word.is_empty() && word.chars().all(plain) { word } else { format!("'{}'", word.replace('\'', "'\\''")) }
}

#[cfg(test)]
mod tests {
    use super::command_line;

    #[test]
    fn commands_can_be_typed_again() {
        let words = ["dcvins", "report", "my log.mcap", "--run", "auto:name=it's", ""].map(str::to_owned);
        assert_eq!(command_line(words), r"dcvins report 'my log.mcap' --run 'auto:name=it'\''s' ''");
    }
}
