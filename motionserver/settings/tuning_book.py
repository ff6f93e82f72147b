"""The tuning in force: its version, its history, and the only way to change it."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import Any, Final

from motionserver.core.limits import Machine
from motionserver.cueing.tuning import Tuning
from motionserver.settings.fields import FieldError, TuningError
from motionserver.settings.tuning import TuningModel, apply_changes, default_for

CHANGES_PER_SECOND: Final = 2
KEPT: Final = 50
"""Tunings that undo can go back to."""
_DETAILS: Final = 8
"""Most field errors of one reply, so that it fits a datagram."""


class TuningBook:
    """Accepts or refuses changes of the tuning; pure but for the clock it is given.

    Args:
        machine: Whose box bounds the tuning.
        now: Clock [s], increasing.
        model: First tuning; the default of the machine if None.

    Raises:
        TuningError: The first tuning asks for more than the machine has.
    """

    def __init__(
        self, machine: Machine, now: Callable[[], float], model: TuningModel | None = None
    ) -> None:
        self._machine = machine
        self._now = now
        self._model = model if model is not None else default_for(machine)
        self._model.check_machine(machine)
        self._replaced = self._model
        self._former: deque[TuningModel] = deque(maxlen=KEPT)
        self._changed: deque[float] = deque(maxlen=CHANGES_PER_SECOND)
        self.version = 1

    @property
    def model(self) -> TuningModel:
        """The tuning in force, in the units of people."""
        return self._model

    @property
    def tuning(self) -> Tuning:
        """The tuning in force, SI."""
        return self._model.to_tuning()

    def answer(self, request: dict[str, Any]) -> dict[str, Any]:
        """Answer one request of the page; never raises for what is in it.

        Args:
            request: {"op": "tuning"}, {"op": "tune", "if_version": n, "changes": {...}} or
                {"op": "undo", "if_version": n}.

        Returns:
            {"ok": True, "version", "values"} or {"ok": False, "error", "kind", "version"} with
            kind "stale", "invalid" or "rate", and "details" (one mapping per field) if invalid.
        """
        op = request.get("op")
        if op == "tuning":
            return self._accepted()
        if op not in ("tune", "undo"):
            return self._refused("invalid", "unknown request, allowed: tuning, tune, undo")
        if request.get("if_version") != self.version or isinstance(request["if_version"], bool):
            return self._refused("stale", f"the tuning is at version {self.version} by now")
        if op == "undo":
            return self._undo()
        changes = request.get("changes")
        if not isinstance(changes, dict) or not all(isinstance(name, str) for name in changes):
            return self._refused("invalid", "changes must be a mapping of names to values")
        return self._tune(changes)

    def take_back(self, why: str) -> dict[str, Any]:
        """Put the tuning in force before the last change back: the last one cannot be used.

        Args:
            why: What stands in the way.

        Returns:
            The refusal to answer with.
        """
        if self._former and self._former[-1] == self._replaced:
            self._former.pop()
        self._model = self._replaced
        self.version += 1
        return self._refused("invalid", why)

    def to_mapping(self) -> dict[str, Any]:
        """Version, values and history as plain values, to be kept over a restart."""
        former = [model.model_dump() for model in self._former]
        return {"version": self.version, "values": self._model.model_dump(), "former": former}

    @classmethod
    def from_mapping(
        cls, data: dict[str, Any], machine: Machine, now: Callable[[], float]
    ) -> TuningBook:
        """Rebuild a book from `to_mapping`; the version goes on counting.

        Raises:
            TuningError: The values are not allowed (any more) or the mapping is not a book.
        """
        version, values, former = data.get("version"), data.get("values"), data.get("former")
        if type(version) is not int or not isinstance(values, dict) or not isinstance(former, list):
            what = FieldError("tuning", None, "version, values and former", "not a tuning book")
            raise TuningError([what])
        book = cls(machine, now, apply_changes(TuningModel(), values))
        book.version = version
        for entry in former[-KEPT:]:
            if isinstance(entry, dict):
                book._former.append(apply_changes(TuningModel(), entry))
        return book

    def _tune(self, changes: dict[str, object]) -> dict[str, Any]:
        try:
            wanted = apply_changes(self._model, changes)
            wanted.check_machine(self._machine)
        except TuningError as error:
            details = [item.to_mapping() for item in error.errors[:_DETAILS]]
            return self._refused("invalid", "values outside what is allowed", details)
        if wanted == self._model:
            return self._accepted()
        if self._too_fast():
            return self._refused("rate", f"more than {CHANGES_PER_SECOND} changes a second")
        self._former.append(self._model)
        return self._put(wanted)

    def _undo(self) -> dict[str, Any]:
        if not self._former:
            return self._refused("invalid", "nothing to undo")
        if self._too_fast():
            return self._refused("rate", f"more than {CHANGES_PER_SECOND} changes a second")
        return self._put(self._former.pop())

    def _too_fast(self) -> bool:
        full = len(self._changed) == CHANGES_PER_SECOND
        return full and self._now() - self._changed[0] < 1.0

    def _put(self, model: TuningModel) -> dict[str, Any]:
        self._changed.append(self._now())
        self._replaced, self._model = self._model, model
        self.version += 1
        return self._accepted()

    def _accepted(self) -> dict[str, Any]:
        return {"ok": True, "version": self.version, "values": self._model.model_dump()}

    def _refused(
        self, kind: str, error: str, details: list[dict[str, object]] | None = None
    ) -> dict[str, Any]:
        reply: dict[str, Any] = {"ok": False, "kind": kind, "error": error, "version": self.version}
        return reply | {"details": details} if details else reply
