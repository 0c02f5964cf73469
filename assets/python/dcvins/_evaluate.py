"""Errors of a trajectory against a reference."""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Dict, Mapping, Union

from ._program import StrPath, call_json, options, text
from ._trajectory import Trajectory


@dataclass(frozen=True)
class Statistics:
    """Statistics of an error over its pairs of poses."""

    rmse: float
    mean: float
    median: float
    std: float
    min: float
    max: float


@dataclass(frozen=True)
class Evaluation:
    """Absolute (`ate_m`) and relative errors as evo computes them, after the alignment."""

    alignment: str
    pairs: int
    estimate_poses: int
    reference_poses: int
    reference_length_m: float
    scale: float
    ate_m: Statistics
    rpe_translation_m: Statistics
    rpe_rotation_deg: Statistics
    rpe_pairs: int

    @classmethod
    def _of(cls, printed: Mapping[str, Any]) -> "Evaluation":
        fields: Dict[str, Any] = {
            name: Statistics(**printed[name]) if isinstance(printed[name], dict) else printed[name]
            for name in cls.__dataclass_fields__
        }
        return cls(**fields)


def evaluate(
    estimate: Union[StrPath, Trajectory],
    reference: Union[StrPath, Trajectory],
    *,
    align: str = "se3",
    delta: str = "1f",
    max_difference: float = 0.01,
) -> Evaluation:
    """Compares two trajectories, as `dcvins evaluate` does: files in TUM's or EuRoC's format, or `Trajectory` values.

    `align` is none, yaw, se3 or sim3; `delta` the interval of the relative error in frames (`"5f"`) or metres (`"10m"`);
    `max_difference` the largest time difference of associated poses in seconds.
    """
    with tempfile.TemporaryDirectory(prefix="dcvins-") as folder:

        def file_of(trajectory: Union[StrPath, Trajectory], name: str) -> str:
            if not isinstance(trajectory, Trajectory):
                return text(trajectory)
            path = Path(folder) / name
            trajectory.write(path)
            return str(path)

        files = [file_of(estimate, "estimate.tum"), file_of(reference, "reference.tum")]
        arguments = options(align=align, delta=delta, max_difference=max_difference)
        return Evaluation._of(call_json(["evaluate", *files, *arguments]))
