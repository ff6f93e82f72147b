import json

import numpy as np
import pytest
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, rule

from motionserver.core.axes import frozen
from motionserver.core.limits import Machine, Pace
from motionserver.settings.fields import TuningError
from motionserver.settings.tuning_book import KEPT, TuningBook


def small_machine():
    none = frozen(np.zeros((6, 3)))
    still = frozen(np.zeros(6))
    box = frozen([0.15, 0.15, 0.15, 0.2, 0.2, 0.2])
    return Machine(
        "small", none, none, 1.0, 0.9, 1.2, 0.6, 8.0, 200.0, None, None, None,
        frozen(np.zeros(3)), still, box, Pace(0.1, 0.5, 2.0),
    )  # fmt: skip


class Clock:
    def __init__(self):
        self.time = 100.0

    def __call__(self):
        return self.time


def tune(book, changes, version=None):
    version = book.version if version is None else version
    return book.answer({"op": "tune", "if_version": version, "changes": changes})


def test_change_raises_the_version_and_undo_brings_the_values_back():
    book = TuningBook(small_machine(), Clock())
    reply = tune(book, {"scale": 0.4})
    assert (reply["ok"], reply["version"], reply["values"]["scale"]) == (True, 2, 0.4)
    reply = book.answer({"op": "undo", "if_version": 2})
    assert (reply["ok"], reply["version"], reply["values"]["scale"]) == (True, 3, 0.6)
    assert book.answer({"op": "undo", "if_version": 3})["error"] == "nothing to undo"


@pytest.mark.parametrize("version", [0, 2, "1", None, True, 1.5])
def test_stale_version_changes_nothing(version):
    book = TuningBook(small_machine(), Clock())
    reply = book.answer({"op": "tune", "if_version": version, "changes": {"scale": 0.1}})
    assert reply["kind"] == "stale"
    assert reply["version"] == book.version == 1
    assert book.model.scale == 0.6


def test_bad_values_are_explained_and_change_nothing():
    book = TuningBook(small_machine(), Clock())
    reply = tune(book, {"scale": float("nan"), "gain": 0.1})
    assert reply["kind"] == "invalid"
    assert reply["details"][0]["field"] == "scale"
    assert book.model.gain == 0.7
    json.dumps(reply, allow_nan=False)


def test_box_may_not_exceed_the_machine():
    reply = tune(TuningBook(small_machine(), Clock()), {"box_surge_m": 0.16})
    assert reply["details"][0]["allowed"] == "0.005 to 0.15 m"


def test_third_change_within_a_second_is_refused_and_later_allowed():
    clock = Clock()
    book = TuningBook(small_machine(), clock)
    assert tune(book, {"scale": 0.1})["ok"]
    clock.time += 0.4
    assert tune(book, {"scale": 0.2})["ok"]
    clock.time += 0.4
    assert tune(book, {"scale": 0.3})["kind"] == "rate"
    assert book.answer({"op": "undo", "if_version": book.version})["kind"] == "rate"
    clock.time += 0.3
    assert tune(book, {"scale": 0.3})["ok"]


def test_same_values_again_are_no_change():
    book = TuningBook(small_machine(), Clock())
    assert tune(book, {"scale": 0.6})["version"] == 1


@pytest.mark.parametrize(
    "request_", [{}, {"op": "engage"}, {"op": ["tune"]}, {"op": "tune", "if_version": 1}]
)
def test_malformed_requests_are_answered(request_):
    assert TuningBook(small_machine(), Clock()).answer(request_)["kind"] == "invalid"


def test_kept_over_a_restart_with_version_and_history():
    clock = Clock()
    book = TuningBook(small_machine(), clock)
    tune(book, {"scale": 0.2})
    saved = json.loads(json.dumps(book.to_mapping()))
    again = TuningBook.from_mapping(saved, small_machine(), clock)
    assert (again.version, again.model) == (2, book.model)
    assert again.answer({"op": "undo", "if_version": 2})["values"]["scale"] == 0.6


@pytest.mark.parametrize(
    "data",
    [
        {},
        {"version": "1", "values": {}, "former": []},
        {"version": 1, "values": {"scale": 7.0}, "former": []},
        {"version": 1, "values": {"box_surge_m": 0.19}, "former": []},
    ],
)
def test_a_bad_saved_book_is_refused(data):
    with pytest.raises(TuningError):
        TuningBook.from_mapping(data, small_machine(), Clock())


class Book(RuleBasedStateMachine):
    """The book against a plain list of scales."""

    def __init__(self):
        super().__init__()
        self.clock = Clock()
        self.book = TuningBook(small_machine(), self.clock)
        self.scales = [0.6]

    @rule(scale=st.sampled_from([0.1, 0.2, 0.3, 0.6, 1.5, -1.0]), late=st.booleans())
    def tune(self, scale, late):
        self.clock.time += 2.0
        reply = tune(self.book, {"scale": scale}, self.book.version - late)
        taken = not late and 0.0 <= scale <= 1.0
        assert reply["ok"] == taken
        if taken and scale != self.scales[-1]:
            self.scales.append(scale)

    @rule()
    def undo(self):
        self.clock.time += 2.0
        reply = self.book.answer({"op": "undo", "if_version": self.book.version})
        assert reply["ok"] == (len(self.scales) > 1)
        if reply["ok"]:
            self.scales.pop()

    @invariant()
    def agrees(self):
        assert self.book.model.scale == self.scales[-1]
        assert len(self.scales) <= KEPT


TestBook = Book.TestCase
TestBook.settings = hypothesis_settings(max_examples=30, stateful_step_count=30, deadline=None)
