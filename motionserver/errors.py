"""All errors of the server, one tree.

MotionServerError
    ConfigError                a file or key a person must mend
    TunableError               a value of a tunable with which no algorithm can be made here
    PluginError                a plug-in that does not load
    PlatformPacketError        bytes on the platform's port that are no answer (platforms.base)
    SourceError                bytes of a simulator that are no sample (sources.base)
    RecordError                a recording that cannot be written or read (telemetry.recorded)
    RecordingError             a recording that cannot be read (evaluate.recording)
"""

from __future__ import annotations


class MotionServerError(Exception):
    """Base of everything the server raises on purpose."""


class ConfigError(MotionServerError):
    """A setting is wrong.

    Attributes:
        where: File and key.
        what: What is wrong with it.
        do: What to do.
    """

    def __init__(self, where: str, what: str, do: str) -> None:
        super().__init__(f"{where}: {what}. {do}")
        self.where = where
        self.what = what
        self.do = do


class TunableError(MotionServerError, ValueError):
    """With this value of a tunable the algorithm cannot be made here.

    Attributes:
        tunable: Its name in the tuning.
        what: What is wrong.
        allowed: What can be used instead.
    """

    def __init__(self, tunable: str, what: str, allowed: str) -> None:
        super().__init__(f"{what}; allowed: {allowed}; change tuning.{tunable}")
        self.tunable = tunable
        self.what = what
        self.allowed = allowed


class PluginError(MotionServerError):
    """A plug-in named by an entry point does not load; the start is stopped."""
