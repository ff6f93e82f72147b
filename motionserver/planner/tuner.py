"""The planner owns the tuning: it serves the page's requests and keeps what is in force."""

from __future__ import annotations

import json
import logging
import time
from typing import Any

from motionserver.bounded_files import SETTINGS_BYTES, read_bounded_text
from motionserver.cueing.tuning import Tuning
from motionserver.planner.options import PlannerOptions
from motionserver.settings.fields import TuningError, algorithms
from motionserver.settings.side_engines import side_names
from motionserver.settings.tuning import apply_changes, default_for
from motionserver.settings.tuning_book import TuningBook

log = logging.getLogger("motionserver.planner")


class Tuner:
    """The book of tunings, kept in the run directory over a restart of this process."""

    def __init__(self, options: PlannerOptions) -> None:
        self._file = options.tuning_file
        machine = options.machine
        self._book = TuningBook(
            machine, time.monotonic, apply_changes(default_for(machine), options.tuning)
        )
        self.side = options.side_engines
        try:
            kept = json.loads(read_bounded_text(self._file, SETTINGS_BYTES))
            self._book = TuningBook.from_mapping(kept, machine, time.monotonic)
            self.side = side_names(kept.get("side", self.side))
        except FileNotFoundError:
            pass
        except (OSError, ValueError, TuningError) as error:
            log.warning("the kept tuning is not used: %s", error)

    def tuning(self) -> Tuning:
        """The tuning in force, SI."""
        return self._book.tuning

    def shown(self) -> dict[str, Any]:
        """Version and values, for the page."""
        return {"version": self._book.version, "values": self._book.model.model_dump()}

    def serve(self, message: dict[str, Any]) -> tuple[dict[str, Any], Tuning | None]:
        """Answer a request.

        Returns:
            The answer, and the new tuning if it changed.
        """
        before = self._book.version
        answer = self._book.answer(message)
        if self._book.version == before:
            return answer, None
        self._keep()
        return answer, self._book.tuning

    def take_back(self, why: str) -> dict[str, Any]:
        """Go back to the tuning before the last one, which cannot be used; the answer to give."""
        answer = self._book.take_back(why)
        self._keep()
        return answer

    def serve_side(self, message: dict[str, Any]) -> tuple[dict[str, Any], tuple[str, ...] | None]:
        """Answer {"op": "side"}, with "engines" to change which run beside the driving one.

        Returns:
            The answer, and the names if they were given and are allowed.
        """
        names = None
        if "engines" in message:
            try:
                names = side_names(message["engines"])
            except TuningError as error:
                details = [item.to_mapping() for item in error.errors]
                refusal = {"ok": False, "kind": "invalid", "error": "engines that are not allowed"}
                return refusal | {"details": details}, None
            self.keep_side(names)
        return {"ok": True, "engines": list(self.side), "allowed": list(algorithms())}, names

    def keep_side(self, names: tuple[str, ...]) -> None:
        """Remember which engines run beside."""
        self.side = names
        self._keep()

    def _keep(self) -> None:
        try:
            temporary = self._file.with_suffix(".new")
            temporary.write_text(
                json.dumps({**self._book.to_mapping(), "side": self.side}), "utf-8"
            )
            temporary.replace(self._file)
        except OSError as error:
            log.warning("the tuning is in force but cannot be kept: %s", error)
