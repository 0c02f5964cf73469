"""Panels of the window as SVG figures."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any, Optional, Sequence, Tuple, Union

from ._program import StrPath, call, options, text, texts


class Figure:
    """A drawing as SVG text, which a notebook shows."""

    def __init__(self, svg: str, values: Optional[str] = None) -> None:
        #: The document.
        self.svg = svg
        #: The values of the panel as CSV, if they were asked for.
        self.values = values

    def _repr_svg_(self) -> str:
        return self.svg

    def __repr__(self) -> str:
        begin = self.svg.find("<title>")
        end = self.svg.find("</title>")
        title = self.svg[begin + len("<title>") : end] if 0 <= begin < end else "without a title"
        return f"Figure: {title}"

    def save(self, path: StrPath) -> None:
        """Writes the SVG; an existing file is an error."""
        with open(path, "x", encoding="utf-8") as file:
            file.write(self.svg)


def figure(
    source: StrPath,
    panel: str = "convergence",
    *,
    runs: Union[str, Sequence[str], None] = None,
    at: Optional[float] = None,
    time_range: Optional[Tuple[Optional[float], Optional[float]]] = None,
    view: Optional[str] = None,
    shown_run: Optional[str] = None,
    width_mm: float = 175.0,
    height_mm: Optional[float] = None,
    font_pt: Optional[float] = None,
    caption: Union[bool, str, None] = None,
    theme: Optional[str] = None,
    values: bool = False,
    rig: Optional[StrPath] = None,
    truth: Optional[StrPath] = None,
    truth_trajectory: Optional[StrPath] = None,
    lever_arm: Optional[str] = None,
    start: Optional[float] = None,
    duration: Optional[float] = None,
    trajectories: Union[str, Sequence[StrPath]] = (),
) -> Figure:
    """Draws a panel of the window on a log or a saved session without a display, as `dcvins screenshot` does.

    `panel` is image, scene, calibration, convergence, rank, jacobian, residuals, inspector, laboratory, comparison,
    breakpoints or timeline; `at` the time in seconds since the log began, by default the end; `time_range` the range of
    all plots, either end may be `None`. `caption=True` adds the legend. `values` also keeps the values as CSV.
    """
    low, high = time_range or (None, None)
    return _draw(
        source,
        values,
        panel=panel,
        run=texts(runs),
        at=at,
        from_=low,
        to=high,
        view=view,
        shown_run=shown_run,
        width_mm=width_mm,
        height_mm=height_mm,
        font_pt=font_pt,
        caption=caption,
        theme=theme,
        rig=rig,
        truth=truth,
        truth_trajectory=truth_trajectory,
        lever_arm=lever_arm,
        start=start,
        duration=duration,
        trajectory=texts(trajectories),
    )


def study_figure(
    study: StrPath,
    panel: str = "distributions",
    *,
    filter: Optional[str] = None,
    group: Optional[str] = None,
    metric: Optional[str] = None,
    reference: Optional[str] = None,
    success: Optional[str] = None,
    size: Optional[Tuple[int, int]] = None,
    theme: Optional[str] = None,
    values: bool = False,
) -> Figure:
    """Draws a panel of a study: runs, distributions, differences, success, parallel or parameters."""
    return _draw(
        study,
        values,
        panel=panel,
        filter=filter,
        group=group,
        metric=metric,
        reference=reference,
        success=success,
        size=None if size is None else f"{size[0]}x{size[1]}",
        theme=theme,
    )


def _draw(source: StrPath, values: bool, **given: Any) -> Figure:
    with tempfile.TemporaryDirectory(prefix="dcvins-") as folder:
        output = Path(folder) / "figure.svg"
        call(["screenshot", text(source), *options(**given, output=output, csv=values)])
        table = next(iter(sorted(Path(folder).glob("*.csv"))), None)
        return Figure(output.read_text(encoding="utf-8"), table.read_text(encoding="utf-8") if table else None)
