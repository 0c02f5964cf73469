//! Outlines of symbols that the reader's text fonts may lack.

/// Outline of a symbol as SVG path data in a square of 16 × 16 with y down; `None` for every other character.
pub(super) fn outline(symbol: char) -> Option<&'static str> {
    Some(match symbol {
        '✔' => "M1.5 8.5L3.5 6.5L6.3 9.3L12.7 2.9L14.5 4.7L6.3 13Z",
        '✖' => "M2.2 4L4 2.2L8 6.2L12 2.2L13.8 4L9.8 8L13.8 12L12 13.8L8 9.8L4 13.8L2.2 12L6.2 8Z",
        '⚠' => "M8 1L15.5 14.5H0.5ZM7.2 5.5V10H8.8V5.5ZM7.2 11.3V12.9H8.8V11.3Z",
        '→' => "M1 7.2H11.2L7.9 3.9L9 2.8L14.2 8L9 13.2L7.9 12.1L11.2 8.8H1Z",
        '←' => "M15 7.2H4.8L8.1 3.9L7 2.8L1.8 8L7 13.2L8.1 12.1L4.8 8.8H15Z",
        '■' => "M2 2H14V14H2Z",
        '▲' => "M8 2L14.5 14H1.5Z",
        '▼' => "M8 14L1.5 2H14.5Z",
        '●' => "M8 2A6 6 0 0 1 8 14A6 6 0 0 1 8 2Z",
        _ => return None,
    })
}
