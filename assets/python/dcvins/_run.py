"""Runs of the estimator on a log."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any, Dict, Iterator, List, Mapping, Optional, Sequence, Tuple, Union

from ._errors import DcvinsError
from ._figures import Figure, figure
from ._program import StrPath, TemporaryFolder, call_json, options, text, texts
from ._tables import Table, from_records, html_table, imported, read_csv
from ._trajectory import Trajectory

if TYPE_CHECKING:
    import numpy

#: Exit codes of `dcvins run` with complete files: success, a run never initialized, a condition became true, a run does
#: not reach the required accuracy.
_WITH_FILES = (0, 3, 5, 7)
#: Tables of a run, without the extension .csv.
_TABLES = ("calibration", "covariance", "rank", "information", "frames")


class Run:
    """Result of one run: the files of its folder (docs/formats.md, Files of a run)."""

    def __init__(self, folder: StrPath) -> None:
        #: Folder of the run's files.
        self.folder = Path(folder)
        #: Name of the run.
        self.label = self.folder.name
        #: Content of summary.json.
        self.summary: Dict[str, Any] = json.loads((self.folder / "summary.json").read_text(encoding="utf-8"))
        self._tables: Dict[str, Table] = {}
        # A temporary folder lives as long as any of its runs.
        self._temporary: Optional[TemporaryFolder] = None

    @property
    def initialized(self) -> bool:
        """True if the run estimated a pose."""
        return int(self.summary["frames"]["estimated"]) > 0

    @property
    def answer(self) -> str:
        """Whether the results can be trusted, the cause if not, and the required accuracy, in one sentence."""
        return str(self.summary["answer"]["sentence"])

    @property
    def ate_rmse_m(self) -> Optional[float]:
        """RMS of the absolute trajectory error in metres, `None` without a ground truth or before initialization."""
        accuracy = self.summary["accuracy"]
        return None if accuracy is None else accuracy["ate_rmse_m"]

    @property
    def warnings(self) -> List[str]:
        """Warnings of the run, one text per kind."""
        return list(self.summary["warnings"])

    @property
    def parameters(self) -> Table:
        """The calibration parameters at the end: `name`, `unit`, `initial`, `final`, `sigma`, `truth`, `error`."""
        return from_records(self.summary["calibration"]["parameters"])

    @property
    def verdicts(self) -> Table:
        """The verdict of the whole flight on each parameter, with `since_s`, `cause`, `reason` and `remedy`."""
        return from_records(self.summary["calibration"]["estimability"])

    @property
    def trajectory(self) -> Trajectory:
        """Poses of the IMU in the run's world, with absolute header stamps."""
        return Trajectory.read(self.folder / "trajectory.tum")

    @property
    def rig(self) -> Path:
        """The rig with the final calibration, for `run(…, rig=…)`."""
        return self.folder / "rig.yaml"

    def table(self, name: str) -> Table:
        """A table of the run: calibration, covariance, rank, information or frames; `t_s` is since the log began."""
        if name not in _TABLES:
            raise DcvinsError(f"no table '{name}'; a run has {', '.join(_TABLES)}")
        if name not in self._tables:
            self._tables[name] = read_csv(self.folder / f"{name}.csv")
        return self._tables[name]

    def value(self, parameter: str) -> Tuple["numpy.ndarray", "numpy.ndarray"]:
        """Times in seconds and estimates of a parameter such as `pitch.d`, in its unit."""
        return self._of(parameter, "")

    def sigma(self, parameter: str) -> Tuple["numpy.ndarray", "numpy.ndarray"]:
        """Times in seconds and standard deviations of a parameter such as `pitch.d`, in its unit."""
        return self._of(parameter, "_sigma")

    def _of(self, parameter: str, quantity: str) -> Tuple["numpy.ndarray", "numpy.ndarray"]:
        table = self.table("calibration")
        for entry in self.summary["calibration"]["parameters"]:
            if entry["name"] == parameter:
                name = f"{parameter}{quantity}_{entry['unit']}" if entry["unit"] else f"{parameter}{quantity}"
                return table["t_s"], table[name]
        known = ", ".join(entry["name"] for entry in self.summary["calibration"]["parameters"])
        raise DcvinsError(f"run '{self.label}' has no parameter '{parameter}'; its parameters are {known}")

    @property
    def pose_covariance(self) -> Tuple["numpy.ndarray", "numpy.ndarray"]:
        """Times in seconds (N) and covariances (N × 6 × 6) of the poses: position in m, then rotations in rad."""
        np = imported("numpy", "a covariance")
        table = self.table("covariance")
        # The upper triangle by rows follows the time.
        names = table.columns[1:22]
        rows, columns = np.triu_indices(6)
        covariance = np.empty((table.rows, 6, 6))
        for name, row, column in zip(names, rows, columns):
            covariance[:, row, column] = covariance[:, column, row] = table[name]
        return table["t_s"], covariance

    def __repr__(self) -> str:
        frames = self.summary["frames"]
        error = "" if self.ate_rmse_m is None else f", ATE {self.ate_rmse_m * 1000:.1f} mm"
        return f"Run {self.label}: {frames['estimated']} of {frames['total']} images with a pose{error}"


class Results(Mapping[str, Run]):
    """Runs on one log by their names, in the order of their specifications."""

    def __init__(self, log: Optional[StrPath] = None, runs: Sequence[str] = ()) -> None:
        self._runs: Dict[str, Run] = {}
        #: The log, if the results come from `run`.
        self.log = log
        #: Condition of `stop_when`, with the run, the time and the values at which it became true.
        self.stopped: Optional[Dict[str, Any]] = None
        self._specifications = list(runs)
        self._log_options: Dict[str, Any] = {}

    def _add(self, folders: Sequence[StrPath], temporary: Optional[TemporaryFolder] = None) -> None:
        for run in map(Run, folders):
            run._temporary = temporary
            self._runs[run.label] = run

    def __getitem__(self, label: str) -> Run:
        if label not in self._runs:
            raise KeyError(f"no run '{label}'; the runs are {', '.join(self._runs)}")
        return self._runs[label]

    def __iter__(self) -> Iterator[str]:
        return iter(self._runs)

    def __len__(self) -> int:
        return len(self._runs)

    def table(self) -> Table:
        """One row per run: images with a pose, ATE, error of the chain and both ranks at the end."""
        return from_records([_row(run) for run in self._runs.values()])

    def figure(self, panel: str = "convergence", **changes: Any) -> Figure:
        """A panel of the window on these runs; the arguments are those of `dcvins.figure`."""
        if self.log is None:
            raise DcvinsError("results that were opened from files have no log; use dcvins.figure(log, panel, runs=…)")
        return figure(self.log, panel, runs=self._specifications, **{**self._log_options, **changes})

    def __repr__(self) -> str:
        return "\n".join(map(repr, self._runs.values()))

    def _repr_html_(self) -> str:
        rows = [_row(run) for run in self._runs.values()]
        return html_table(list(rows[0]) if rows else [], [tuple(map(_cell, row.values())) for row in rows])


def _row(run: Run) -> Dict[str, Any]:
    summary = run.summary
    error = summary["calibration"]["chain_error"] or {}
    rank = summary["rank"] or {}
    return {
        "run": run.label,
        "images": summary["frames"]["total"],
        "estimated": summary["frames"]["estimated"],
        "ate_rmse_m": run.ate_rmse_m,
        "chain_error_m": error.get("translation_mean_m"),
        "chain_error_rad": error.get("rotation_mean_rad"),
        "columns": summary["calibration"]["columns"],
        "rank_structural": rank.get("rank_structural"),
        "rank_informed": rank.get("rank_informed"),
    }


def _cell(value: Any) -> str:
    return "" if value is None else f"{value:.4g}" if isinstance(value, float) else str(value)


def run(
    log: StrPath,
    runs: Union[str, Sequence[str]] = "auto",
    *,
    out: Optional[StrPath] = None,
    rig: Optional[StrPath] = None,
    truth: Optional[StrPath] = None,
    truth_trajectory: Optional[StrPath] = None,
    lever_arm: Union[str, Sequence[float], None] = None,
    start: Optional[float] = None,
    duration: Optional[float] = None,
    trajectories: Union[str, Sequence[StrPath]] = (),
    stop_when: Optional[str] = None,
    require: Union[str, bool] = False,
    timing: bool = True,
    mcap: bool = False,
    euroc: bool = False,
    force: bool = False,
) -> Results:
    """Runs the estimator on a log or a recording, as `dcvins run` does.

    `runs` are up to four specifications such as `"auto"` or `"minimal:encoder=off,name=free"` (docs/commands.md, Run
    specifications). `out` receives one folder per run; without it the files are in a temporary folder that lives as long
    as the result. `stop_when` is the condition of `--break`, `require` the accuracy of `--require`, such as
    `"translation=5mm,rotation=0.1deg"`, or `True` for the accuracy of the rig; `Run.answer` then says whether it is reached.
    `timing=False` omits measured times, so that two runs give the same bytes. A run that never initialized is a result
    with `initialized` false.
    """
    specifications = texts(runs) or []
    arm = lever_arm if lever_arm is None or isinstance(lever_arm, str) else ",".join(map(str, lever_arm))
    log_options: Dict[str, Any] = {
        "rig": rig,
        "truth": truth,
        "truth_trajectory": truth_trajectory,
        "lever_arm": arm,
        "start": start,
        "duration": duration,
        "trajectories": texts(trajectories),
    }
    results = Results(log, specifications)
    results._log_options = {name: value for name, value in log_options.items() if value}
    temporary = TemporaryFolder() if out is None else None
    folder = temporary.path if temporary else text(out)
    given = {**log_options, "trajectory": log_options["trajectories"]}
    del given["trajectories"]
    arguments = options(
        **given,
        run=specifications,
        out=folder,
        break_=stop_when,
        require=require,
        no_timing=not timing,
        mcap=mcap,
        euroc=euroc,
        force=force,
    )
    printed = call_json(["run", text(log), *arguments], _WITH_FILES)
    summaries = printed["runs"] if isinstance(printed, dict) else printed
    results._add([Path(folder) / summary["run"] for summary in summaries], temporary)
    results.stopped = printed["break"]["hit"] if isinstance(printed, dict) else None
    return results


def open_results(folder: StrPath) -> Results:
    """The runs in a folder that `dcvins run --out` or `dcvins report -o` wrote."""
    folders = sorted(path.parent for path in Path(folder).glob("*/summary.json"))
    if not folders:
        raise DcvinsError(f"no run: no folder in it has a summary.json: {folder}")
    results = Results()
    results._add(folders)
    return results
