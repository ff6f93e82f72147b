"""Clients: senders, replay and device emulators; they know the wire, not the server."""

from .recording import (
    RecordedSample,
    Recording,
    RecordingError,
    read_recording,
    recording_names,
    recording_path,
)
from .replay import ReplayCounts, replay
from .sender import CueSender

__all__ = [
    "CueSender",
    "RecordedSample",
    "Recording",
    "RecordingError",
    "ReplayCounts",
    "read_recording",
    "recording_names",
    "recording_path",
    "replay",
]
