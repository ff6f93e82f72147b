"""The planner owns the tuning: it serves the page's requests and keeps what is asked for."""

from __future__ import annotations

import json
import logging
import time
from collections.abc import Iterator
from typing import Any, Final

from motionserver.bounded_files import SETTINGS_BYTES, read_bounded_text
from motionserver.cueing.base import Cueing
from motionserver.cueing.think import Thinker
from motionserver.cueing.tuning import Tuning
from motionserver.planner.options import PlannerOptions
from motionserver.planner.sides import Sides
from motionserver.settings.fields import TuningError, algorithms
from motionserver.settings.side_engines import side_names
from motionserver.settings.tuning import TuningModel, apply_changes, default_for
from motionserver.settings.tuning_book import TuningBook
from motionserver.settings.tuning_proof import make_with

_LONGEST: Final = 500
"""Most characters of a text for the page."""

log = logging.getLogger("motionserver.planner")


class Tuner:
    """The book of tunings, kept in the run directory over a restart of this process.

    Attributes:
        side: Names of the engines that run beside the driving one.
        cueing: The driving algorithm as it was made at the start.
        fallback: Why another tuning than the kept one was taken at the start; empty otherwise.

    Raises:
        TuningError: With no tuning at all can an algorithm be made.
    """

    def __init__(self, options: PlannerOptions) -> None:
        self._file, self._machine = options.tuning_file, options.machine
        self._period = options.period
        self.side = options.side_engines
        self.fallback = ""
        self._prepared: Cueing | None = None
        self._seen: tuple[object, object, object] | None = None
        self._shown: dict[str, Any] | None = None
        self._first = apply_changes(default_for(self._machine), options.tuning)
        self._book = TuningBook(self._machine, time.monotonic, self._first, self._prepare)
        self._read()
        self.cueing = self._start()

    def tuning(self) -> Tuning:
        """The tuning asked for, SI."""
        return self._book.tuning

    def shown(self, thinker: Thinker) -> dict[str, Any]:
        """For the page: version and values asked for, and those that are in force."""
        values = self._book.model.values()
        return {"version": self._book.version, "values": values} | self._told_of(thinker)

    def serve(
        self, message: dict[str, Any], thinker: Thinker
    ) -> tuple[dict[str, Any], Tuning | None]:
        """Answer a request.

        Returns:
            The answer, and the new tuning if it changed; then `taking_over` has its algorithm.
        """
        before = self._book.version
        self._prepared = self._seen = None
        answer = self._book.answer(message)
        if self._book.version == before:
            return answer | (self._told_of(thinker) if answer["ok"] else {}), None
        self.fallback = ""
        self._keep()
        return answer, self._book.tuning

    def accepted(self, thinker: Thinker) -> dict[str, Any]:
        """The answer to a change that the engine has taken."""
        return {"ok": True} | self.shown(thinker)

    def take_back(self, why: str) -> dict[str, Any]:
        """Go back to the tuning before the last one, which cannot be used; the answer to give."""
        answer = self._book.take_back(why)
        self._keep()
        return answer

    def taking_over(self) -> Cueing | None:
        """The algorithm that proved the last change, as it was made; given away once."""
        prepared, self._prepared = self._prepared, None
        return prepared

    def look(self, thinker: Thinker) -> None:
        """Note once that a tuning has come into force as asked for."""
        if self._book.has_worked or thinker.is_ramping or thinker.refused:
            return
        if self._shown_in_force(thinker) == self._book.model.values():
            self._book.mark_worked()
            self._keep()

    def serve_side(self, message: dict[str, Any], sides: Sides, tuning: Tuning) -> dict[str, Any]:
        """Answer {"op": "side"}, with "engines" to change which run beside the driving one.

        Args:
            message: The request.
            sides: What runs beside; changed if every name asked for can be made.
            tuning: The driving engine's.
        """
        if "engines" in message:
            try:
                names = side_names(message["engines"])
                sides.take(names, tuning)
            except TuningError as error:
                return refused_engines(error)
            self.keep_side(names)
        return {
            "ok": True,
            "engines": list(self.side),
            "running": list(sides.running),
            "allowed": list(algorithms()),
        }

    def keep_side(self, names: tuple[str, ...]) -> None:
        """Remember which engines run beside."""
        self.side = names
        self._keep()

    def _prepare(self, wanted: TuningModel, former: TuningModel) -> None:
        self._prepared = make_with(self._machine, self._period, wanted, former)

    def _told_of(self, thinker: Thinker) -> dict[str, Any]:
        return {
            "in_force": self._shown_in_force(thinker),
            "is_ramping": thinker.is_ramping,
            "retune_error": thinker.refused[:300],
            "fallback": self.fallback,
        }

    def _shown_in_force(self, thinker: Thinker) -> dict[str, Any] | None:
        """What the engine has, in the units of the page; None if it tells nonsense.

        Read anew whenever something was asked for or handed to the engine since.
        """
        state = (self._book.model, thinker.cueing, thinker.tuning)
        if self._seen is None or any(a is not b for a, b in zip(state, self._seen, strict=True)):
            self._seen = state
            try:
                self._shown = self._book.model.showing(thinker.in_force)
            except TuningError:
                self._shown = None
        return self._shown

    def _read(self) -> None:
        """Take what was kept by the planner before, if it was kept and is still allowed."""
        try:
            kept = json.loads(read_bounded_text(self._file, SETTINGS_BYTES))
            self._book = TuningBook.from_mapping(kept, self._machine, time.monotonic, self._prepare)
            self.side = side_names(kept.get("side", self.side))
        except FileNotFoundError:
            return
        except (OSError, ValueError, AttributeError, TuningError) as error:
            self.fallback = f"The kept tuning is not allowed ({error}); the configured one is used."
            self.fallback = self.fallback[:_LONGEST]
            log.warning("%s", self.fallback)
        for warning in self._book.warnings:
            log.warning("kept tuning: %s", warning)

    def _start(self) -> Cueing:
        """Make the algorithm: with what was kept, else with the newest tuning that worked."""
        asked, version = self._book.model, self._book.version
        try:
            return make_with(self._machine, self._period, asked)
        except TuningError as error:
            why = error
        for model in self._candidates():
            try:
                cueing = make_with(self._machine, self._period, model)
            except TuningError:
                continue
            self._book.fall_back(model)
            self.fallback = (
                f"Version {version} of the tuning cannot be used ({why}); the last one that "
                f"worked is back as version {self._book.version}."
            )[:_LONGEST]
            log.warning("%s", self.fallback)
            self._keep()
            return cueing
        raise why

    def _candidates(self) -> Iterator[TuningModel]:
        yield from self._book.fallbacks()
        yield self._first
        yield default_for(self._machine)

    def _keep(self) -> None:
        try:
            temporary = self._file.with_suffix(".new")
            temporary.write_text(
                json.dumps({**self._book.to_mapping(), "side": self.side}), "utf-8"
            )
            temporary.replace(self._file)
        except OSError as error:
            log.warning("the tuning is in force but cannot be kept: %s", error)


def refused_engines(error: TuningError) -> dict[str, Any]:
    """The answer to a list of side engines that cannot run."""
    details = [item.to_mapping() for item in error.errors]
    what = {"ok": False, "kind": "invalid", "error": "engines that are not allowed"}
    return what | {"details": details}
