"""The tuning asked for: its version, its history, and the only way to change it."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, Final

from motionserver.core.limits import Machine
from motionserver.cueing.tuning import Tuning
from motionserver.settings.fields import FieldError, TuningError
from motionserver.settings.tuning import TuningModel, apply_changes, default_for, readable
from motionserver.settings.tuning_scope import without_effect

CHANGES_PER_SECOND: Final = 2
KEPT: Final = 50
"""Tunings that undo can go back to."""
_DETAILS: Final = 8
"""Most field errors of one reply, so that it fits a datagram."""

Prepare = Callable[[TuningModel, TuningModel], None]
"""Proves that the first can be used, the second being in force; raises `TuningError` if not."""


@dataclass(frozen=True, slots=True)
class _Entry:
    """A tuning of the history, and whether it has been in force."""

    model: TuningModel
    has_worked: bool


class TuningBook:
    """Accepts or refuses changes of the tuning; pure but for the clock it is given.

    Args:
        machine: Whose box bounds the tuning.
        now: Clock [s], increasing.
        model: First tuning; the default of the machine if None.
        prepare: Makes the algorithm with a changed tuning before it is accepted; None where
            nothing is driven.

    Attributes:
        version: Counts the changes.
        has_worked: Whether the tuning has been in force.
        warnings: What was left out of a file of an earlier version.

    Raises:
        TuningError: The first tuning asks for more than the machine has.
    """

    def __init__(
        self,
        machine: Machine,
        now: Callable[[], float],
        model: TuningModel | None = None,
        prepare: Prepare | None = None,
    ) -> None:
        self._machine = machine
        self._now = now
        self._default = default_for(machine)
        self._model = model if model is not None else self._default
        self._model.check_machine(machine)
        self._prepare = prepare
        self._replaced = _Entry(self._model, has_worked=False)
        self._former: deque[_Entry] = deque(maxlen=KEPT)
        self._changed: deque[float] = deque(maxlen=CHANGES_PER_SECOND)
        self.has_worked = False
        self.version = 1
        self.warnings: list[str] = []

    @property
    def model(self) -> TuningModel:
        """The tuning asked for, in the units of people."""
        return self._model

    @property
    def tuning(self) -> Tuning:
        """The tuning asked for, SI."""
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
        """Put the tuning before the last change back: the last one did not come into force.

        Args:
            why: What stood in the way.

        Returns:
            The refusal to answer with.
        """
        if self._former and self._former[-1].model == self._replaced.model:
            self._former.pop()
        self._model, self.has_worked = self._replaced.model, self._replaced.has_worked
        self.version += 1
        return self._refused("invalid", why)

    def mark_worked(self) -> None:
        """Note that the tuning is in force: a later start may fall back to it."""
        self.has_worked = True

    def fallbacks(self) -> Iterator[TuningModel]:
        """Tunings of the history to fall back to: the newest that has worked first."""
        newest = list(reversed(self._former))
        yield from (entry.model for entry in newest if entry.has_worked)
        yield from (entry.model for entry in newest if not entry.has_worked)

    def fall_back(self, model: TuningModel) -> None:
        """Replace a tuning that cannot be used by another one; undo does not lead back to it."""
        if any(entry.model == model for entry in self._former):
            while self._former.pop().model != model:
                pass
        self._model, self.has_worked = model, False
        self.version += 1

    def to_mapping(self) -> dict[str, Any]:
        """Version, values and history as plain values, to be kept over a restart."""
        former = [{"values": e.model.values(), "worked": e.has_worked} for e in self._former]
        return {
            "version": self.version,
            "values": self._model.values(),
            "worked": self.has_worked,
            "former": former,
        }

    @classmethod
    def from_mapping(
        cls,
        data: dict[str, Any],
        machine: Machine,
        now: Callable[[], float],
        prepare: Prepare | None = None,
    ) -> TuningBook:
        """Rebuild a book from `to_mapping`; the version goes on counting.

        Files of earlier versions are read as well: their history holds plain values, and tunables
        that were removed since are left out with a warning. What of the history is not allowed any
        more is dropped with a warning.

        Raises:
            TuningError: The values are not allowed (any more) or the mapping is not a book.
        """
        version, values, former = data.get("version"), data.get("values"), data.get("former")
        if type(version) is not int or not isinstance(values, dict) or not isinstance(former, list):
            what = FieldError("tuning", None, "version, values and former", "not a tuning book")
            raise TuningError([what])
        kept, warnings = readable(values, drop_unknown=True)
        book = cls(machine, now, apply_changes(default_for(machine), kept), prepare)
        book.version = version
        book.warnings = warnings
        book.has_worked = data.get("worked") is True
        for entry in former[-KEPT:]:
            book._remember(entry)
        return book

    def _remember(self, entry: object) -> None:
        if not isinstance(entry, dict):
            return
        inner = entry.get("values")
        values, has_worked = (inner, entry.get("worked") is True) if inner else (entry, False)
        try:
            model = apply_changes(self._default, readable(dict(values), drop_unknown=True)[0])
            model.check_machine(self._machine)
        except (TuningError, TypeError, ValueError) as error:
            self.warnings.append(f"an earlier tuning is dropped from the history: {error}"[:300])
            return
        self._former.append(_Entry(model, has_worked))

    def _tune(self, changes: dict[str, object]) -> dict[str, Any]:
        try:
            wanted = apply_changes(self._model, changes)
            wanted.check_machine(self._machine)
            same = (self._model.values(), self._default.values())
            if dead := without_effect(changes, wanted.algorithm, same):
                raise TuningError(dead)
        except TuningError as error:
            return self._invalid("values outside what is allowed", error)
        if wanted == self._model:
            return self._accepted()
        if self._too_fast():
            return self._refused("rate", f"more than {CHANGES_PER_SECOND} changes a second")
        try:
            self._prove(wanted)
        except TuningError as error:
            return self._invalid("a value that cannot be used here; nothing was changed", error)
        self._former.append(_Entry(self._model, self.has_worked))
        return self._put(wanted)

    def _undo(self) -> dict[str, Any]:
        if not self._former:
            return self._refused("nothing", "nothing to undo")
        if self._too_fast():
            return self._refused("rate", f"more than {CHANGES_PER_SECOND} changes a second")
        wanted = self._former.pop().model
        try:
            self._prove(wanted)
        except TuningError as error:
            what = "the tuning before cannot be used any more and has left the history; nothing "
            return self._invalid(what + "was changed, undo again to go further back", error)
        return self._put(wanted)

    def _prove(self, wanted: TuningModel) -> None:
        if self._prepare is not None:
            self._prepare(wanted, self._model)

    def _too_fast(self) -> bool:
        full = len(self._changed) == CHANGES_PER_SECOND
        return full and self._now() - self._changed[0] < 1.0

    def _put(self, model: TuningModel) -> dict[str, Any]:
        self._changed.append(self._now())
        self._replaced = _Entry(self._model, self.has_worked)
        self._model, self.has_worked = model, False
        self.version += 1
        return self._accepted()

    def _accepted(self) -> dict[str, Any]:
        return {"ok": True, "version": self.version, "values": self._model.values()}

    def _invalid(self, error: str, why: TuningError) -> dict[str, Any]:
        details = [item.to_mapping() for item in why.errors[:_DETAILS]]
        return self._refused("invalid", error, details)

    def _refused(
        self, kind: str, error: str, details: list[dict[str, object]] | None = None
    ) -> dict[str, Any]:
        reply: dict[str, Any] = {"ok": False, "kind": kind, "error": error, "version": self.version}
        return reply | {"details": details} if details else reply
