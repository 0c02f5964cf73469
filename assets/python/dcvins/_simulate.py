"""Simulated flights."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import List, Mapping, Optional, Sequence, Tuple, Union

from ._program import StrPath, call, options, texts


@dataclass(frozen=True)
class Flight:
    """Files of a simulated flight: log, given rig and ground truth of the rig."""

    log: Path
    rig: Path
    truth: Path


def simulate(
    experiment: str,
    output: StrPath,
    *,
    seed: int = 1,
    duration: Optional[float] = None,
    size: Optional[Tuple[int, int]] = None,
    rate: Optional[float] = None,
    encoder_sigma_deg: Union[float, str, None] = None,
    mirror: bool = False,
    static_camera: bool = True,
    motion: Optional[StrPath] = None,
    rig: Optional[StrPath] = None,
    disturb: Union[Mapping[str, object], Sequence[str]] = (),
    force: bool = False,
) -> Flight:
    """Writes a synthetic flight of the paper's experiment T1, T2, T3 or T4, as `dcvins simulate` does.

    `output` is the log, a path that ends in .mcap. `duration` is in seconds, `size` the width and height of the images in
    pixels, `rate` in images per second, `encoder_sigma_deg` in degrees or `"none"`. `disturb` has disturbances by name,
    `{"readout": 0.02, "blank": "11,1"}`, or as texts, `["readout=0.02"]` (docs/commands.md, simulate).
    """
    disturbances: Optional[List[str]]
    if isinstance(disturb, Mapping):
        disturbances = [f"{name}={value}" for name, value in disturb.items()]
    else:
        disturbances = texts(disturb)
    given = options(
        output=output,
        seed=seed,
        duration=duration,
        size=None if size is None else f"{size[0]}x{size[1]}",
        rate=rate,
        encoder_sigma_deg=encoder_sigma_deg,
        mirror=mirror,
        no_static_camera=not static_camera,
        motion=motion,
        rig=rig,
        disturb=disturbances,
        force=force,
    )
    call(["simulate", experiment, *given])
    log = Path(output)
    return Flight(log, log.with_suffix(".rig.yaml"), log.with_suffix(".truth.yaml"))
