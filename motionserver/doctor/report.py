"""The examination's result as text and as JSON."""

from __future__ import annotations

import os
import textwrap
from dataclasses import dataclass
from typing import Any, Final

from motionserver import __version__
from motionserver.doctor.finding import Finding, Level, worst
from motionserver.evaluate.bench.report import describe_machine, machine_text

FORMAT: Final = 1
"""Of the JSON; a change that breaks a reader raises it."""
WIDTH: Final = 100
_NAMES: Final = 23
_BELOW: Final = " " * 9
_INDENT: Final = " " * (9 + _NAMES + 1)


@dataclass(frozen=True, slots=True)
class Report:
    """All findings of one examination.

    Attributes:
        promise: What rate can be promised, in one sentence.
        findings: In the order they were made.
        measured: Figures of the process that only slept; None if it could not be started.
        config: The configuration that was looked at; None without one.
    """

    promise: str
    findings: tuple[Finding, ...]
    measured: dict[str, Any] | None
    config: str | None

    @property
    def exit_status(self) -> int:
        """1 if there is a problem, else 0."""
        return int(worst(self.findings) is Level.PROBLEM)

    def to_mapping(self) -> dict[str, Any]:
        """Write it for JSON."""
        return {
            "format": FORMAT,
            "version": __version__,
            "promise": self.promise,
            "worst": str(worst(self.findings)),
            "config": self.config,
            "measured": self.measured,
            "machine": describe_machine(),
            "findings": [finding.to_mapping() for finding in self.findings],
        }

    def to_text(self) -> str:
        """The promise, the worst findings first, each with its mend below it."""
        counts = {level: 0 for level in reversed(Level)}
        for finding in self.findings:
            counts[finding.level] += 1
        lines = [self.promise, machine_text(describe_machine())]
        lines += [f"limits and permissions are those of user {os.getuid()} in this session", ""]
        for finding in sorted(self.findings, key=lambda one: -one.level.rank):
            lines += _lines_of(finding)
        lines += ["", ", ".join(f"{count} {level}" for level, count in counts.items())]
        if self.config is None:
            lines.append("give CONFIG.toml to have its ports, files and platform looked at")
        return "\n".join(lines)


def _lines_of(finding: Finding) -> list[str]:
    """One line for what is well; what is not also says what it means and how to mend it."""
    lines = textwrap.wrap(
        f"{finding.level:<9}{finding.name:<{_NAMES}} {finding.found}",
        WIDTH,
        subsequent_indent=_INDENT,
        break_long_words=False,
        break_on_hyphens=False,
    )
    if finding.level is not Level.OK:
        lines.append(f"{_BELOW}means: {finding.means}")
    if finding.mend:
        # unbroken: it is there to be copied
        lines.append(f"{_BELOW}mend:  {finding.mend}")
    return lines
