"""The page's sign of life for the service, which replaces a page that stands still."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Final

from motionserver.telemetry.mapped import MappedFile

PERIOD: Final = 1.0
"""Time between two signs [s]."""


class Heart:
    """Beats while the page's loop turns; without a service there is nobody to hear it.

    Args:
        path: The mapped file of the run directory.
    """

    def __init__(self, path: Path) -> None:
        self._file = MappedFile(path) if path.exists() else None

    async def beat(self) -> None:
        """Beat until cancelled."""
        while self._file is not None:
            self._file.write(b"")
            await asyncio.sleep(PERIOD)
