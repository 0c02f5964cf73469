"""Trajectories in TUM's format."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ._errors import DcvinsError
from ._program import StrPath
from ._tables import imported

if TYPE_CHECKING:
    import numpy


class Trajectory:
    """Poses of a body over time.

    `t_s` has N absolute stamps in seconds, `position_m` the positions (N × 3) and `quaternion_xyzw` the orientations
    (N × 4, x y z w), which rotate from the body to the world.
    """

    def __init__(self, t_s: "numpy.ndarray", position_m: "numpy.ndarray", quaternion_xyzw: "numpy.ndarray") -> None:
        np = imported("numpy", "a trajectory")
        self.t_s = np.asarray(t_s, dtype=float)
        self.position_m = np.asarray(position_m, dtype=float)
        self.quaternion_xyzw = np.asarray(quaternion_xyzw, dtype=float)
        count = len(self.t_s)
        shapes = (self.t_s.shape, self.position_m.shape, self.quaternion_xyzw.shape)
        if shapes != ((count,), (count, 3), (count, 4)):
            raise DcvinsError(f"a trajectory needs arrays of N, N × 3 and N × 4 numbers; their shapes are {shapes}")

    def __len__(self) -> int:
        return len(self.t_s)

    def __repr__(self) -> str:
        if len(self) == 0:
            return "Trajectory without poses"
        return f"Trajectory of {len(self)} poses, {self.t_s[-1] - self.t_s[0]:.2f} s, {self.length_m:.2f} m"

    @property
    def length_m(self) -> float:
        """Length of the path in metres."""
        np = imported("numpy", "a trajectory")
        return float(np.linalg.norm(np.diff(self.position_m, axis=0), axis=1).sum())

    @classmethod
    def read(cls, path: StrPath) -> "Trajectory":
        """Reads a file in TUM's format: `t x y z qx qy qz qw`, seconds and metres; lines with # are comments."""
        np = imported("numpy", "a trajectory")
        rows = []
        with open(path, encoding="utf-8") as file:
            for number, line in enumerate(file, 1):
                fields = line.split("#", 1)[0].split()
                if not fields:
                    continue
                try:
                    row = [float(field) for field in fields]
                except ValueError:
                    row = []
                if len(row) != 8:
                    raise DcvinsError(f"line {number} is not 't x y z qx qy qz qw': {path}")
                rows.append(row)
        table = np.array(rows, dtype=float).reshape(len(rows), 8)
        return cls(table[:, 0], table[:, 1:4], table[:, 4:8])

    def write(self, path: StrPath) -> None:
        """Writes a file in TUM's format; an existing file is an error."""
        with open(path, "x", encoding="utf-8") as file:
            for t_s, position, quaternion in zip(self.t_s, self.position_m, self.quaternion_xyzw):
                file.write(" ".join([f"{t_s:.9f}", *(repr(float(value)) for value in (*position, *quaternion))]) + "\n")
