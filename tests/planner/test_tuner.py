"""What the planner accepts is made before it answers, and read back from the engine afterwards."""

import json
import sys
from dataclasses import replace
from importlib import import_module

import numpy as np
import pytest
from machines import compact

from motionserver.core.axes import frozen
from motionserver.core.plan import rest_at
from motionserver.core.state import STILL
from motionserver.cueing.registry import algorithms
from motionserver.cueing.think import Thinker
from motionserver.planner.options import PlannerOptions
from motionserver.planner.sides import Sides
from motionserver.planner.tuner import Tuner
from motionserver.settings.fields import TuningError
from motionserver.settings.tuning import apply_changes, default_for, describe
from motionserver.settings.tuning_proof import make_with
from motionserver.settings.tuning_scope import names_of

PERIOD = 1 / 60
MACHINE = compact()
HOMES = frozen(np.stack((np.zeros(6), MACHINE.parked_pose)))
OURS = ("mpc", "thondel2014", "classical")
LIBRARIES = {"daqp": "daqp", "osqp": "osqp", "piqp": "piqp", "hpipm": "hpipm_library"}


def options_in(folder, **tuning):
    return PlannerOptions(
        machine=MACHINE,
        period=PERIOD,
        send_period=PERIOD,
        budget=0.01,
        arm=frozen(np.zeros(3)),
        inputs=(),
        tuning=tuning,
        tuning_file=folder / "tuning.json",
        sessions_file=folder / "sessions.bin",
        realtime=False,
    )


class Planner:
    """Tuner and thinker as the planner's loop joins them, in virtual time."""

    def __init__(self, folder, **tuning):
        self.options = options_in(folder, **tuning)
        self.tuner = Tuner(self.options)
        self.thinker = Thinker(MACHINE, self.tuner.tuning(), PERIOD, HOMES, self.tuner.cueing)
        self.sides = Sides(MACHINE, PERIOD, HOMES, ())
        self.time = 0.0
        self.tuner._book._now = lambda: self.time

    def ask(self, op, **more):
        self.time += 1.0
        answer, tuning = self.tuner.serve({"op": op, **more}, self.thinker)
        if tuning is None:
            return answer
        self.thinker.retune(tuning, None, self.tuner.taking_over())
        return self.tuner.accepted(self.thinker)

    def tune(self, **changes):
        version = self.ask("tuning")["version"]
        return self.ask("tune", if_version=version, changes=changes)

    def undo(self):
        return self.ask("undo", if_version=self.ask("tuning")["version"])

    def settle(self):
        self.thinker.settle()
        self.tuner.look(self.thinker)
        return self.ask("tuning")

    def think(self, periods):
        plan = rest_at(np.zeros(6), 1)
        for number in range(periods):
            self.thinker.think(plan, None, 0.1, STILL, 10 + number)


@pytest.fixture
def planner(tmp_path):
    return Planner(tmp_path)


@pytest.fixture
def hide(monkeypatch):
    """Make the library of a solver as absent as if it had never been installed."""

    def hidden(backend):
        module = f"motionserver.solvers.{backend}"
        if backend == "hpipm":
            library = import_module("motionserver.solvers.hpipm_library")
            library._library.cache_clear() if hasattr(library, "_library") else None
            monkeypatch.setattr(library, "find_spec", lambda _: None)
        else:
            monkeypatch.setitem(sys.modules, backend, None)
        monkeypatch.delitem(sys.modules, module, raising=False)

    return hidden


def choices():
    """Every choice of every tunable that is no number, with an algorithm that reads it."""
    for field in describe(MACHINE):
        for value in field.get("choices", ()):
            for algorithm in field["algorithms"]:
                if algorithm in OURS and field["name"] != "algorithm":
                    yield algorithm, field["name"], value


@pytest.mark.parametrize(("algorithm", "name", "value"), list(choices()))
def test_choice_that_is_accepted_is_in_force_and_any_other_refused(
    tmp_path, hide, algorithm, name, value
):
    hide("hpipm")
    planner = Planner(tmp_path, algorithm=algorithm)
    before = planner.settle()
    answer = planner.tune(**{name: value})
    after = planner.settle()
    assert after["in_force"] == after["values"]
    if answer["ok"]:
        assert after["values"][name] == value
    else:
        # a solver that is not installed; a forecast from drives without the file that holds it
        assert (name, value) in (("backend", "hpipm"), ("reference", "learned"))
        assert answer["details"][0]["field"] in ("backend", "predictor")
        assert after["values"] == before["values"]
        assert after["version"] == before["version"]


@pytest.mark.parametrize("algorithm", OURS)
@pytest.mark.parametrize("end", ["min", "max"])
def test_both_ends_of_every_number_are_in_force_once_accepted(tmp_path, algorithm, end):
    planner = Planner(tmp_path, algorithm=algorithm)
    for field in describe(MACHINE):
        if end not in field or algorithm not in field["algorithms"]:
            continue
        answer = planner.tune(**{field["name"]: field[end]})
        assert answer["ok"], (field["name"], answer)
        told = planner.settle()
        assert told["in_force"] == told["values"]
        assert told["values"][field["name"]] == field[end]


@pytest.mark.parametrize("backend", list(LIBRARIES))
@pytest.mark.parametrize("algorithm", ["mpc", "thondel2014"])
def test_solver_without_its_library_is_refused_with_reason_and_remedy(
    tmp_path, hide, algorithm, backend
):
    other = "osqp" if backend != "osqp" else "piqp"
    planner = Planner(tmp_path, algorithm=algorithm, backend=other)
    before = planner.settle()
    hide(backend)
    answer = planner.tune(backend=backend)
    assert (answer["ok"], answer["kind"]) == (False, "invalid")
    (detail,) = answer["details"]
    assert (detail["field"], detail["value"]) == ("backend", backend)
    assert "pip install" in detail["allowed"]
    assert other in detail["allowed"]
    assert planner.settle() == before
    # and nothing is poisoned: the next change comes into force
    assert planner.tune(scale=0.3)["ok"]
    assert planner.settle()["in_force"]["scale"] == 0.3


def test_switching_to_an_algorithm_whose_solver_is_missing_is_refused(tmp_path, hide):
    planner = Planner(tmp_path, algorithm="classical")
    hide("daqp")
    answer = planner.tune(algorithm="mpc")
    assert [d["field"] for d in answer["details"]] == ["backend"]
    assert planner.settle()["in_force"]["algorithm"] == "classical"
    assert planner.tune(algorithm="mpc", backend="piqp")["ok"]
    assert planner.settle()["in_force"]["backend"] == "piqp"


def test_horizon_too_short_for_the_planners_period_is_refused_by_name(tmp_path):
    planner = Planner(tmp_path)
    options = replace(planner.options, period=1 / 20)
    tuner = Tuner(options)
    thinker = Thinker(MACHINE, tuner.tuning(), options.period, HOMES, tuner.cueing)
    request = {"op": "tune", "if_version": 1, "changes": {"horizon_s": 0.5, "scale": 0.4}}
    answer, tuning = tuner.serve(request, thinker)
    assert tuning is None
    assert [d["field"] for d in answer["details"]] == ["horizon_s"]
    assert "0.75 s" in answer["details"][0]["allowed"]


def test_numbers_are_ramped_and_told_as_they_are_meanwhile(planner):
    planner.settle()
    answer = planner.tune(scale=0.2)
    assert answer["values"]["scale"] == 0.2
    assert (answer["in_force"]["scale"], answer["is_ramping"]) == (0.6, True)
    planner.think(30)
    half = planner.ask("tuning")
    assert 0.2 < half["in_force"]["scale"] < 0.6
    assert half["is_ramping"]
    planner.think(40)
    done = planner.ask("tuning")
    assert (done["in_force"], done["is_ramping"]) == (done["values"], False)


def test_in_force_is_read_from_the_engine_and_not_an_echo(planner):
    planner.settle()
    planner.thinker.cueing.retune(replace(planner.thinker.tuning, backend="piqp", tilt_rate=0.1))
    told = planner.ask("tuning")
    assert told["values"]["backend"] == "daqp"
    assert told["in_force"]["backend"] == "piqp"
    assert told["in_force"]["tilt_rate_deg_s"] == pytest.approx(np.degrees(0.1))


def test_engine_that_does_not_take_a_change_keeps_the_old_one_and_says_so(planner, monkeypatch):
    planner.settle()
    monkeypatch.setattr(planner.thinker.cueing, "retune", _raise)
    assert planner.tune(scale=0.3)["ok"]
    monkeypatch.setattr("motionserver.cueing.think.make_cueing", _raise)
    planner.think(80)
    told = planner.ask("tuning")
    assert (told["in_force"]["scale"], told["is_ramping"]) == (0.6, False)
    assert "lost its library" in told["retune_error"]
    monkeypatch.undo()
    assert planner.tune(scale=0.4)["ok"]
    told = planner.settle()
    assert (told["in_force"], told["retune_error"]) == (told["values"], "")


def _raise(*_):
    raise RuntimeError("lost its library")


def kept(folder, values, former, **more):
    (folder / "tuning.json").write_text(
        json.dumps({"version": 7, "values": values, "former": former, **more})
    )


def everything(**changes):
    return apply_changes(default_for(MACHINE), changes).values()


@pytest.mark.parametrize("layout", ["marked", "plain"])
def test_start_falls_back_to_the_last_tuning_that_worked_and_says_so(
    tmp_path, hide, caplog, layout
):
    hide("hpipm")
    worked, later = everything(scale=0.3), everything(scale=0.4, backend="hpipm")
    former = {
        "marked": [{"values": worked, "worked": True}, {"values": later, "worked": True},
                   {"values": everything(scale=0.5), "worked": False}],
        "plain": [worked, later],
    }[layout]  # fmt: skip
    kept(tmp_path, everything(backend="hpipm"), former, side=[])
    planner = Planner(tmp_path)
    told = planner.settle()
    assert told["values"]["scale"] == 0.3
    assert told["in_force"] == told["values"]
    assert told["version"] == 8
    assert "Version 7" in told["fallback"]
    assert "hpipm" in told["fallback"]
    assert "version 8" in caplog.text
    again = Planner(tmp_path).settle()
    assert (again["values"]["scale"], again["fallback"]) == (0.3, "")
    assert planner.tune(scale=0.35)["fallback"] == ""


def test_start_without_any_history_falls_back_to_the_configured_tuning(tmp_path, hide):
    hide("hpipm")
    kept(tmp_path, everything(backend="hpipm"), [])
    told = Planner(tmp_path, scale=0.25).settle()
    assert told["values"]["scale"] == 0.25
    assert told["in_force"] == told["values"]


def test_tuning_is_marked_as_worked_once_it_is_in_force(planner):
    file = planner.options.tuning_file
    planner.settle()
    planner.tune(scale=0.3)
    assert json.loads(file.read_text())["worked"] is False
    planner.think(30)
    planner.tuner.look(planner.thinker)
    assert json.loads(file.read_text())["worked"] is False
    planner.settle()
    data = json.loads(file.read_text())
    assert data["worked"] is True
    assert [entry["worked"] for entry in data["former"]] == [True]


def test_kept_tuning_of_an_earlier_version_is_read_with_a_warning(tmp_path, caplog):
    old = {**everything(scale=0.45), "translation_threshold_m_s2": 0.2}
    kept(tmp_path, old, [old, {"scale": 9.0}], side=["classical"])
    planner = Planner(tmp_path)
    assert planner.settle()["values"]["scale"] == 0.45
    assert "translation_threshold_m_s2" in caplog.text
    assert planner.tuner.side == ("classical",)


@pytest.mark.parametrize("text", ["", "[]", "{}", "nonsense", '{"version": 1, "values": 3}'])
def test_kept_file_that_is_none_is_replaced_by_the_configuration(tmp_path, text):
    (tmp_path / "tuning.json").write_text(text)
    told = Planner(tmp_path, scale=0.25).settle()
    assert told["values"]["scale"] == 0.25
    assert told["fallback"]


def test_undo_to_what_cannot_be_made_any_more_is_refused_and_does_not_block(tmp_path, hide):
    planner = Planner(tmp_path)
    planner.settle()
    assert planner.tune(scale=0.3)["ok"]
    assert planner.tune(backend="piqp")["ok"]
    assert planner.tune(backend="osqp")["ok"]
    hide("piqp")
    refusal = planner.undo()
    assert refusal["details"][0]["field"] == "backend"
    assert planner.settle()["in_force"]["backend"] == "osqp"
    assert planner.undo()["values"]["backend"] == "daqp"


def test_tunable_that_the_algorithm_does_not_read_is_refused_naming_those_that_do(planner):
    for name in set(everything()) - set(names_of("mpc")):
        field = next(f for f in describe(MACHINE) if f["name"] == name)
        value = next((c for c in field.get("choices", ()) if c != field["default"]), None)
        value = field["max"] if value is None else value
        answer = planner.tune(**{name: value})
        (detail,) = answer["details"]
        assert detail["field"] == name
        assert "has no effect with mpc" in detail["message"]
        assert all(user in detail["message"] for user in field["algorithms"])
    assert planner.ask("tuning")["version"] == 1
    # together with an algorithm that reads it, it acts
    assert planner.tune(algorithm="classical", gain=0.4)["ok"]
    assert planner.settle()["in_force"]["gain"] == 0.4


def test_side_engine_that_cannot_be_made_is_refused_by_name(planner, hide):
    planner.tune(algorithm="classical")
    planner.settle()
    hide("daqp")
    tuning = planner.thinker.tuning
    request = {"op": "side", "engines": ["thondel2014"]}
    answer = planner.tuner.serve_side(request, planner.sides, tuning)
    assert (answer["ok"], answer["details"][0]["value"]) == (False, "thondel2014")
    assert planner.sides.running == ()
    assert planner.tuner.serve_side({"op": "side"}, planner.sides, tuning)["engines"] == []


def test_side_engine_that_is_accepted_runs(planner):
    request = {"op": "side", "engines": ["classical"]}
    answer = planner.tuner.serve_side(request, planner.sides, planner.thinker.tuning)
    assert (answer["engines"], answer["running"]) == (["classical"], ["classical"])


def test_error_of_a_plug_in_names_the_one_change_at_fault(monkeypatch):
    monkeypatch.setattr("motionserver.settings.tuning_proof.prepare", _raise)
    default = default_for(MACHINE)
    with pytest.raises(TuningError) as caught:
        make_with(MACHINE, PERIOD, apply_changes(default, {"scale": 0.1}), default)
    (error,) = caught.value.errors
    assert (error.field, error.value) == ("scale", 0.1)
    assert "lost its library" in error.message


def test_all_installed_algorithms_are_tried_here():
    assert set(OURS) <= set(algorithms())
