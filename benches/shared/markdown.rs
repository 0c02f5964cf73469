use std::fmt;

/// Writes a table's title, header and rows.
pub(crate) fn write_table(
    formatter: &mut impl fmt::Write,
    title: &str,
    header: &[&str],
    rows: &[Vec<String>],
) -> fmt::Result {
    writeln!(formatter, "{title}\n")?;
    writeln!(formatter, "{}", head(header))?;
    for row in rows {
        writeln!(formatter, "{}", line(row))?;
    }
    Ok(())
}

/// The two lines with which a table begins.
pub(crate) fn head(header: &[&str]) -> String {
    format!("{}\n{}", line(header), line(&vec!["---"; header.len()]))
}

/// One row of a table.
pub(crate) fn line<T: AsRef<str>>(cells: &[T]) -> String {
    let cells: Vec<&str> = cells.iter().map(AsRef::as_ref).collect();
    format!("| {} |", cells.join(" | "))
}
