use std::fmt;

/// Writes a table's title, header and rows.
pub(crate) fn write_table(
    formatter: &mut fmt::Formatter<'_>,
    title: &str,
    header: &[&str],
    rows: &[Vec<String>],
) -> fmt::Result {
    writeln!(formatter, "{title}\n")?;
    writeln!(formatter, "| {} |", header.join(" | "))?;
    writeln!(formatter, "| {} |", vec!["---"; header.len()].join(" | "))?;
    for row in rows {
        writeln!(formatter, "| {} |", row.join(" | "))?;
    }
    Ok(())
}
