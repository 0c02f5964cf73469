"""The program `dcvins`: finding it, starting it, and its errors as exceptions."""

from __future__ import annotations

import json
import os
import shutil
import site
import subprocess
import sys
import sysconfig
import tempfile
import weakref
from pathlib import Path
from typing import Any, Iterable, Iterator, List, Optional, Sequence, Union

from ._errors import CommandFailed, ProgramNotFound

StrPath = Union[str, "os.PathLike[str]"]

#: Environment variable with the path of the program.
VARIABLE = "DCVINS"
#: Name of the program's file.
NAME = "dcvins.exe" if sys.platform == "win32" else "dcvins"


def _beside_the_package() -> Iterator[Path]:
    """Places where pip installs the program together with this package, the most likely first."""
    package = Path(__file__).resolve().parent
    yield Path(sysconfig.get_path("scripts")) / NAME
    # `pip install --user` and `pip install --prefix`, then `pip install --target`.
    yield Path(site.getuserbase()) / ("Scripts" if sys.platform == "win32" else "bin") / NAME
    for parents_up in (3, 2):
        if len(package.parents) > parents_up:
            yield package.parents[parents_up] / "bin" / NAME
    yield package.parent / "bin" / NAME


def find_program() -> str:
    """Path of the program: the one that DCVINS names, else the one installed with this package, else that of the PATH.

    Raises `ProgramNotFound` without one, or if DCVINS names no program.
    """
    given = os.environ.get(VARIABLE)
    if given:
        found = shutil.which(given)
        if found is None:
            raise ProgramNotFound(f"{VARIABLE} is '{given}', which is no program; set it to the path of dcvins or unset it")
        return found
    for place in _beside_the_package():
        if place.is_file() and os.access(place, os.X_OK):
            return str(place)
    found = shutil.which(NAME)
    if found is None:
        raise ProgramNotFound(
            f"the program dcvins was not found: neither beside the package nor on the PATH; install the wheel of dcvins "
            f"or set {VARIABLE} to the path of the program"
        )
    return found


def program_version() -> str:
    """Version of the program with its commit, such as `0.2.0 (1a2b3c4d5e6f)`."""
    return call(["--version"]).stdout.strip().split(" ", 1)[-1]


def call(arguments: Sequence[str], accepted: Iterable[int] = (0,)) -> "subprocess.CompletedProcess[str]":
    """Runs the program to its end and returns its output.

    Raises `CommandFailed` for an exit code that is not among the accepted ones. An interrupt (Ctrl+C) ends the program.
    """
    command = [find_program(), *arguments]
    process = subprocess.Popen(
        command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, encoding="utf-8"
    )
    try:
        output, errors = process.communicate()
    except BaseException:
        process.terminate()
        process.wait()
        raise
    if process.returncode not in set(accepted):
        raise CommandFailed(command, process.returncode, _message(errors, process.returncode))
    return subprocess.CompletedProcess(command, process.returncode, output, errors)


def call_json(arguments: Sequence[str], accepted: Iterable[int] = (0,)) -> Any:
    """Runs a command with --json and returns the value that it prints."""
    return json.loads(call([*arguments, "--json"], accepted).stdout)


def _message(errors: str, exit_code: int) -> str:
    """The error at the end of the program's standard error, without the notices and progress before it."""
    lines = errors.strip().splitlines()
    for number in reversed(range(len(lines))):
        for prefix in ("dcvins: ", "error: "):
            if lines[number].startswith(prefix):
                # Wrong use ends with a pointer to --help.
                kept = [line for line in lines[number:] if not line.startswith("For more information, try")]
                return "\n".join(kept)[len(prefix) :].strip()
    last = lines[-1] if lines else "no message"
    return f"dcvins ended with code {exit_code}: {last}"


def options(**given: Any) -> List[str]:
    """Arguments of the command line: `max_difference=0.1` is `--max-difference 0.1`.

    `None` and `False` give nothing, `True` the option alone, a list the option once for each value.
    """
    arguments: List[str] = []
    for name, value in given.items():
        option = "--" + name.rstrip("_").replace("_", "-")
        if value is True:
            arguments.append(option)
        elif value is not None and value is not False:
            values = value if isinstance(value, (list, tuple)) else [value]
            for single in values:
                # One argument, so that a value may begin with a hyphen.
                arguments.append(f"{option}={text(single)}")
    return arguments


class TemporaryFolder:
    """A new folder that is removed with the last reference to this value, or at the end of the interpreter."""

    def __init__(self) -> None:
        self.path = tempfile.mkdtemp(prefix="dcvins-")
        weakref.finalize(self, shutil.rmtree, self.path, ignore_errors=True)


def text(value: Any) -> str:
    """An argument's text; numbers and paths as the program reads them."""
    return os.fspath(value) if isinstance(value, os.PathLike) else str(value)


def texts(values: Union[str, Sequence[StrPath], None]) -> Optional[List[str]]:
    """A single text or a sequence of texts as a list."""
    if values is None:
        return None
    return [values] if isinstance(values, (str, os.PathLike)) else [text(value) for value in values]
