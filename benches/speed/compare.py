"""Alternates the unit and runs of dcvins, and prints the processor time per image of each and their ratio.

`compare.py DCVINS LOG REPETITIONS`; see `check`.
"""

import json
import resource
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

# Largest ratio of a run's processor time per image to the unit; for `cluster` per pair of images.
TARGETS = {"static": 1.2, "auto": 1.6, "cluster": 2.6}


def unit_ms(log):
    """Processor time of the unit, in milliseconds per image."""
    unit = Path(__file__).with_name("unit.py")
    return float(subprocess.run([sys.executable, unit, log], check=True, capture_output=True).stdout)


def run_ms(dcvins, log, spec):
    """Processor time of a run, in milliseconds per image or per pair of images, whole process."""
    with tempfile.TemporaryDirectory() as folder:
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        command = [dcvins, "run", log, "--run", spec, "-o", folder, "--json"]
        output = subprocess.run(command, check=True, capture_output=True).stdout
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
    frames = json.loads(output)[0]["frames"]["total"]
    used_s = after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime
    return used_s * 1e3 / frames


def spread(values, digits):
    """Median and range."""
    return f"{statistics.median(values):.{digits}f} ({min(values):.{digits}f}–{max(values):.{digits}f})"


def main():
    dcvins, log, repetitions = sys.argv[1], sys.argv[2], int(sys.argv[3])
    units, runs = [], {spec: [] for spec in TARGETS}
    ratios = {spec: [] for spec in TARGETS}
    for _ in range(repetitions):
        for spec in TARGETS:
            # The speed of a shared machine changes from minute to minute: each run is divided by a separate measurement of the unit.
            unit, run = unit_ms(log), run_ms(dcvins, log, spec)
            units.append(unit)
            runs[spec].append(run)
            ratios[spec].append(run / unit)
    print(f"unit: {spread(units, 2)} ms per image, median (range) of {len(units)}")
    print("| run | ms of processor time per image | ratio to the unit | target |")
    print("| --- | --- | --- | --- |")
    for spec, target in TARGETS.items():
        print(f"| {spec} | {spread(runs[spec], 2)} | {spread(ratios[spec], 2)} | ≤ {target} |")


main()
