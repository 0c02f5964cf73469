"""Exceptions of the module."""

from __future__ import annotations

from typing import Sequence


class DcvinsError(Exception):
    """Base of every exception that the module defines."""


class ProgramNotFound(DcvinsError):
    """The program `dcvins` is neither named by DCVINS, nor beside the package, nor on the PATH."""


class MissingPackage(DcvinsError, ImportError):
    """A Python package that only some results need is not installed."""


class CommandFailed(DcvinsError):
    """The program ended with an error; the text of the exception is the program's message.

    `command` has the program and its arguments, `exit_code` the code (docs/commands.md lists them; negative: the number
    of the signal that ended it) and `message` the text.
    """

    def __init__(self, command: Sequence[str], exit_code: int, message: str) -> None:
        super().__init__(message)
        self.command = list(command)
        self.exit_code = exit_code
        self.message = message
