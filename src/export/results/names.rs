//! Names of the topics and frames of one run.

/// Prefix of the topics and frames of one run.
pub(super) struct Names {
    /// The label; characters that ROS does not allow in a topic are replaced.
    label: String,
}

impl Names {
    pub(super) fn new(label: &str) -> Self {
        let allowed = |letter: char| if letter.is_ascii_alphanumeric() { letter } else { '_' };
        let label: String = label.chars().map(allowed).collect();
        // The name of a topic must not begin with a digit.
        let digit = label.starts_with(|first: char| first.is_ascii_digit());
        Self { label: if digit || label.is_empty() { format!("run_{label}") } else { label } }
    }

    pub(super) fn topic(&self, name: &str) -> String {
        format!("/{}/{name}", self.label)
    }

    pub(super) fn frame(&self, name: &str) -> String {
        format!("{}/{name}", self.label)
    }
}
