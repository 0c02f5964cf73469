"""Checks of logs and rigs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Dict, Optional, Tuple

from ._program import StrPath, call_json, options, text
from ._tables import Table, from_records, html_table

#: Exit codes of `dcvins check`: no errors found, errors found.
_CHECKED = (0, 4)


@dataclass(frozen=True)
class Finding:
    """One finding with its evidence and remedy; `severity` is good, note, warning or error."""

    severity: str
    area: str
    title: str
    evidence: str
    remedy: str

    def __str__(self) -> str:
        parts = [f"{self.severity}: {self.area}: {self.title}", self.evidence, self.remedy]
        return "\n  ".join(part for part in parts if part)


@dataclass(frozen=True)
class Check:
    """Verdict and findings on a log and its rig."""

    #: trusted, doubtful or not_usable.
    trust: str
    #: The verdict in one sentence.
    sentence: str
    findings: Tuple[Finding, ...]
    #: The printed JSON as a whole.
    json: Dict[str, Any]

    @property
    def errors(self) -> Tuple[Finding, ...]:
        """The findings that are errors."""
        return tuple(finding for finding in self.findings if finding.severity == "error")

    @property
    def warnings(self) -> Tuple[Finding, ...]:
        """The findings that are warnings."""
        return tuple(finding for finding in self.findings if finding.severity == "warning")

    @property
    def topics(self) -> Table:
        """The topics of the log with their role, number of messages, rate and latency."""
        return from_records(self.json["topics"])

    def __str__(self) -> str:
        shown = [finding for finding in self.findings if finding.severity != "good"]
        return "\n".join([self.sentence, *map(str, shown)])

    def _repr_html_(self) -> str:
        rows = [(found.severity, found.area, found.title, found.evidence, found.remedy) for found in self.findings]
        head = ("severity", "area", "title", "evidence", "remedy")
        return f"<p><b>{self.sentence}</b></p>" + html_table(head, rows)


def check(log: StrPath, *, rig: Optional[StrPath] = None) -> Check:
    """Checks a log or recording and its rig, as `dcvins check` does; errors of the log are findings, no exceptions."""
    found = call_json(["check", text(log), *options(rig=rig)], _CHECKED)
    names = Finding.__dataclass_fields__
    findings = tuple(Finding(**{name: finding.get(name) or "" for name in names}) for finding in found["findings"])
    return Check(found["verdict"]["trust"], found["verdict"]["sentence"], findings, found)
