"""Visual-inertial navigation with a camera on a gimbal: runs, checks, studies and figures of the program `dcvins`.

Every function starts the program (see `find_program`), waits for it and returns what it wrote::

    import dcvins

    results = dcvins.run("garden.mcap", ["auto", "classical"])
    auto = results["auto"]
    auto.verdicts.frame()                     # pandas: the verdict on every calibration parameter
    t_s, sigma = auto.sigma("pitch.d")        # NumPy: σ over time
    results.figure("convergence")             # an SVG that a notebook shows

Units are those of the files (docs/formats.md): metres, radians, seconds, pixels; quaternions are x y z w.
An error of the program is an exception with its message: `CommandFailed`.
NumPy is imported for arrays and pandas for frames, when they are first asked for; neither is needed otherwise.
"""

from __future__ import annotations

from ._calibration import Calibration, calibrate, calibrate_stills
from ._check import Check, Finding, check
from ._errors import CommandFailed, DcvinsError, MissingPackage, ProgramNotFound
from ._evaluate import Evaluation, Statistics, evaluate
from ._figures import Figure, figure
from ._program import find_program, program_version
from ._run import Results, Run, open_results, run
from ._simulate import Flight, simulate
from ._study import Study, open_study, sweep
from ._tables import Table
from ._trajectory import Trajectory

__all__ = [
    "Calibration",
    "Check",
    "CommandFailed",
    "DcvinsError",
    "Evaluation",
    "Figure",
    "Finding",
    "Flight",
    "MissingPackage",
    "ProgramNotFound",
    "Results",
    "Run",
    "Statistics",
    "Study",
    "Table",
    "Trajectory",
    "calibrate",
    "calibrate_stills",
    "check",
    "evaluate",
    "figure",
    "find_program",
    "open_results",
    "open_study",
    "program_version",
    "run",
    "simulate",
    "sweep",
]
