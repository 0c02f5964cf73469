"""Offline calibrations."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Dict, Optional, Sequence

from ._program import StrPath, TemporaryFolder, call_json, options, text
from ._tables import Table, from_records, read_csv


class Calibration:
    """Result of `dcvins calibrate`: its files (docs/formats.md) and calibration.json."""

    def __init__(self, out: Optional[StrPath]) -> None:
        self._temporary = TemporaryFolder() if out is None else None
        #: Folder of the files.
        self.folder = Path(self._temporary.path if self._temporary else text(out))
        #: Content of calibration.json.
        self.json: Dict[str, Any] = {}

    @property
    def rig(self) -> Path:
        """The calibrated rig, for `run(…, rig=…)`."""
        stills = self.folder / "gimbal.rig.yaml"
        return stills if stills.exists() else self.folder / "rig.yaml"

    @property
    def report(self) -> str:
        """The printed report."""
        return (self.folder / "report.txt").read_text(encoding="utf-8")

    @property
    def parameters(self) -> Table:
        """The parameters with their initial and final values and σ; those of stills in every parameterization."""
        table = self.folder / "parameters.csv"
        return read_csv(table) if table.exists() else from_records(self.json["parameters"])

    def __str__(self) -> str:
        return self.report

    def __repr__(self) -> str:
        return f"Calibration of {self.parameters.rows} parameters: {self.folder}"


def _calibrate(arguments: Sequence[str], out: Optional[StrPath]) -> Calibration:
    calibration = Calibration(out)
    calibration.json = call_json(["calibrate", *arguments, *options(out=calibration.folder)])
    return calibration


def calibrate(
    log: StrPath,
    out: Optional[StrPath] = None,
    *,
    rig: Optional[StrPath] = None,
    truth: Optional[StrPath] = None,
    start: Optional[float] = None,
    duration: Optional[float] = None,
    trajectory: bool = False,
    force: bool = False,
) -> Calibration:
    """Calibrates static camera and gimbal from a flight with both, as `dcvins calibrate` does.

    `out` receives the files; without it they are in a temporary folder that lives as long as the result. `trajectory`
    also writes the estimated trajectory with its covariances.
    """
    given = options(rig=rig, truth=truth, start=start, duration=duration, trajectory=trajectory, force=force)
    return _calibrate([text(log), *given], out)


def calibrate_stills(
    stills: StrPath,
    out: Optional[StrPath] = None,
    *,
    chain: Optional[StrPath] = None,
    joint_angles: str = "encoder",
    folds: int = 5,
    without: Sequence[str] = (),
    force: bool = False,
) -> Calibration:
    """Calibrates a gimbal from still images of known points with joint readings, as `dcvins calibrate --stills` does.

    `chain` judges the chain of a rig instead, `joint_angles` is encoder or free, `folds` the number of groups of stations
    that are left out in turn, `without` the ids of sets that are not used.
    """
    ids = ",".join(without) or None
    given = options(stills=stills, chain=chain, joint_angles=joint_angles, folds=folds, without=ids, force=force)
    return _calibrate(given, out)
