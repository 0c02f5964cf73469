"""Studies: many runs and their tables."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, Mapping, Optional

from ._errors import DcvinsError
from ._figures import Figure, study_figure
from ._program import StrPath, call_json, options, text
from ._tables import Table, imported, read_csv

if TYPE_CHECKING:
    import pandas

#: Exit codes of `dcvins sweep` with complete tables: success, some jobs without a result.
_WITH_TABLES = (0, 6)


class Study:
    """Tables of a folder that `dcvins sweep` wrote (docs/formats.md, Studies)."""

    def __init__(self, folder: StrPath) -> None:
        #: Folder of the study.
        self.folder = Path(folder)
        #: Printed result of the sweep: number of jobs that are done, skipped, failed, missing; empty if opened.
        self.json: Mapping[str, Any] = {}
        if not (self.folder / "results.csv").is_file():
            raise DcvinsError(f"no study: it has no results.csv: {self.folder}")

    @property
    def runs(self) -> Table:
        """One row per run, with its inputs, `status` and results."""
        return read_csv(self.folder / "results.csv")

    @property
    def parameters(self) -> Table:
        """One row per run and calibration parameter."""
        return read_csv(self.folder / "parameters.csv")

    def frames(self) -> "pandas.DataFrame":
        """One row per run and image, as a pandas frame; the plan has to ask for it, and pandas needs pyarrow."""
        path = self.folder / "frames.parquet"
        if not path.is_file():
            raise DcvinsError(f"the study has no table of images; its plan needs 'frames = true' under [output]: {path}")
        read_parquet = imported("pandas", "a frame").read_parquet
        imported("pyarrow", "a table in Parquet")
        frame: "pandas.DataFrame" = read_parquet(path, engine="pyarrow")
        return frame

    def figure(self, panel: str = "distributions", **given: Any) -> Figure:
        """A panel of the study: runs, distributions, differences, success, parallel or parameters.

        Further arguments: `metric`, `group`, `reference`, `filter`, `success`, `size` in pixels, `theme`, `values`.
        """
        return study_figure(self.folder, panel, **given)

    def __repr__(self) -> str:
        return f"Study of {self.runs.rows} runs: {self.folder}"


def sweep(
    plan: StrPath,
    out: StrPath,
    *,
    jobs: Optional[int] = None,
    memory: Optional[float] = None,
    retry_failed: bool = False,
    baseline: Optional[StrPath] = None,
    tolerance: Optional[Mapping[str, float]] = None,
) -> Study:
    """Runs every job of a plan that has no result yet and writes the tables, as `dcvins sweep` does.

    `memory` is in GiB. Jobs without a result are rows with their `status` and `message`; a metric that is worse than in
    the table `baseline` by more than `tolerance` (ratios by column) raises `CommandFailed`.
    """
    given = options(
        out=out,
        jobs=jobs,
        memory=memory,
        retry_failed=retry_failed,
        baseline=baseline,
        tolerance=[f"{name}={ratio}" for name, ratio in (tolerance or {}).items()],
    )
    printed = call_json(["sweep", text(plan), *given], _WITH_TABLES)
    study = Study(out)
    study.json = printed
    return study


def open_study(folder: StrPath) -> Study:
    """The study in a folder of `dcvins sweep`."""
    return Study(folder)
