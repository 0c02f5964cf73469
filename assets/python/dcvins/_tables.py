"""Tables as NumPy arrays and pandas frames."""

from __future__ import annotations

import csv
import importlib
import math
from typing import TYPE_CHECKING, Any, Dict, Iterator, List, Mapping, Optional, Sequence, Tuple

from ._errors import DcvinsError, MissingPackage
from ._program import StrPath

if TYPE_CHECKING:
    import numpy
    import pandas


def imported(package: str, needed_for: str) -> Any:
    """Imports a package that only some results need; `MissingPackage` says how to get it."""
    try:
        return importlib.import_module(package)
    except ImportError as error:
        raise MissingPackage(
            f"{needed_for} needs the package {package}, which is not installed: pip install {package}"
        ) from error


class Table(Mapping[str, "numpy.ndarray"]):
    """Columns of equal length by name.

    `table["t_s"]` is a NumPy array: numbers as float64 with NaN for an empty cell, counts of JSON as int64, otherwise texts.
    `table.frame()` is the table as a pandas frame, `len(table.columns)` and `table.rows` are its size.
    """

    def __init__(self, columns: Mapping[str, Sequence[Any]], rows: int) -> None:
        self._columns: Dict[str, Sequence[Any]] = dict(columns)
        self._arrays: Dict[str, "numpy.ndarray"] = {}
        #: Number of rows.
        self.rows = rows

    @property
    def columns(self) -> List[str]:
        """Names of the columns in their order."""
        return list(self._columns)

    def __getitem__(self, name: str) -> "numpy.ndarray":
        if name not in self._columns:
            raise KeyError(f"no column '{name}'; the columns are {', '.join(self._columns)}")
        if name not in self._arrays:
            self._arrays[name] = _array(self._columns[name])
        return self._arrays[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._columns)

    def __len__(self) -> int:
        return len(self._columns)

    def __repr__(self) -> str:
        return f"Table of {self.rows} rows: {', '.join(self._columns)}"

    def _repr_html_(self) -> Optional[str]:
        try:
            frame = self.frame()
        except MissingPackage:
            return None
        return str(frame.to_html())

    def frame(self) -> "pandas.DataFrame":
        """The table as a pandas frame."""
        pd = imported("pandas", "a frame")
        frame: "pandas.DataFrame" = pd.DataFrame({name: self[name] for name in self._columns})
        return frame


def _array(cells: Sequence[Any]) -> "numpy.ndarray":
    np = imported("numpy", "an array")
    array: "numpy.ndarray"
    if cells and all(type(cell) is type(cells[0]) and isinstance(cell, int) for cell in cells):
        # Counts and flags of JSON.
        array = np.array(cells)
        return array
    try:
        array = np.array([math.nan if cell in ("", None) else float(cell) for cell in cells], dtype=np.float64)
    except (TypeError, ValueError):
        array = np.array(["" if cell is None else str(cell) for cell in cells], dtype=object)
    return array


def read_csv(path: StrPath) -> Table:
    """A table of a CSV file with a line of names."""
    with open(path, newline="", encoding="utf-8") as file:
        rows = csv.reader(file)
        names = next(rows, None)
        if not names:
            raise DcvinsError(f"no table: the file has no line of names: {path}")
        cells = list(rows)
    for number, row in enumerate(cells):
        if len(row) != len(names):
            raise DcvinsError(f"line {number + 2} has {len(row)} cells instead of {len(names)}: {path}")
    return Table({name: [row[index] for row in cells] for index, name in enumerate(names)}, len(cells))


def from_records(records: Sequence[Mapping[str, Any]]) -> Table:
    """A table with one row per record of a JSON list, in the order of the first record's keys."""
    names: List[str] = []
    for record in records:
        names.extend(name for name in record if name not in names)
    return Table({name: [record.get(name) for record in records] for name in names}, len(records))


def html_table(head: Sequence[str], rows: Sequence[Tuple[str, ...]]) -> str:
    """A small HTML table for a notebook; cells are texts."""
    import html

    def line(cells: Sequence[str], tag: str) -> str:
        return "<tr>" + "".join(f"<{tag}>{html.escape(cell)}</{tag}>" for cell in cells) + "</tr>"

    body = "".join(line(row, "td") for row in rows)
    return f"<table><thead>{line(head, 'th')}</thead><tbody>{body}</tbody></table>"
