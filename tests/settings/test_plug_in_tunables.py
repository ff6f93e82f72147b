"""An installed cueing plug-in brings tunables of its own: declared, bounded, shown, in force."""

import itertools
import sys
import textwrap

import numpy as np
import pytest
from machines import compact
from web_world import World

from motionserver.core.axes import frozen
from motionserver.cueing import registry
from motionserver.cueing.think import Thinker
from motionserver.settings.fields import TuningError
from motionserver.settings.tuning import TuningModel, apply_changes, default_for, describe
from motionserver.settings.tuning_book import TuningBook
from motionserver.settings.tuning_proof import make_with
from motionserver.settings.tuning_scope import names_of

MACHINE = compact()
PERIOD = 1 / 60
NUMBERS = itertools.count()
PLUG_IN = """
from typing import Literal
from pydantic import BaseModel, Field
from motionserver.cueing.classical import Classical

class Options(BaseModel):
    push: float = Field(0.5, ge=0.0, le=2.0, description="How hard it pushes.")
    shape: Literal["round", "square"] = "round"
    is_eager: bool = False

class Soft(Classical):
    name = "soft"
    tunables = frozenset({"gain"})
    Options = Options

    def __init__(self, machine, tuning, period):
        super().__init__(machine, tuning, period)
        if tuning.own["shape"] == "square":
            raise RuntimeError("square is not built yet")
        self.push = tuning.own["push"]

    def retune(self, tuning):
        super().retune(tuning)
        self.push = tuning.own["push"]
"""


def install(folder, monkeypatch, text, name="soft"):
    module = f"plug_in_number_{next(NUMBERS)}"
    (folder / f"{module}.py").write_text(textwrap.dedent(text))
    info = folder / f"{name}-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(f"[motionserver.cueing]\n{name} = {module}:Soft\n")
    monkeypatch.syspath_prepend(str(folder))
    registry._plugins.cache_clear()
    return module


@pytest.fixture
def installed(tmp_path, monkeypatch):
    folder = tmp_path / "site"
    folder.mkdir()
    yield lambda text, name="soft": install(folder, monkeypatch, text, name)
    monkeypatch.undo()
    registry._plugins.cache_clear()


def test_options_are_described_and_belong_to_their_algorithm(installed):
    installed(PLUG_IN)
    fields = {field["name"]: field for field in describe(MACHINE)}
    push = fields["soft_push"]
    assert (push["min"], push["max"], push["default"]) == (0.0, 2.0, 0.5)
    assert (push["algorithms"], push["meaning"]) == (["soft"], "How hard it pushes.")
    assert fields["soft_shape"]["choices"] == ["round", "square"]
    assert fields["soft_is_eager"]["choices"] == [False, True]
    shared = {"algorithm", "scale", "gain"}
    assert set(names_of("soft")) == shared | {"soft_push", "soft_shape", "soft_is_eager"}
    assert "soft" in fields["gain"]["algorithms"]
    assert "soft" not in fields["rotation_gain"]["algorithms"]
    assert "soft_push" not in names_of("classical")


def test_option_is_bounded_by_the_plug_ins_own_model(installed):
    installed(PLUG_IN)
    model = apply_changes(TuningModel(), {"soft_push": 1.5})
    assert model.values()["soft_push"] == 1.5
    assert model.to_tuning().options["soft"]["push"] == 1.5
    assert TuningModel.from_tuning(model.to_tuning()) == model
    for name, value in {"soft_push": 2.5, "soft_shape": "oval", "soft_is_eager": 1}.items():
        with pytest.raises(TuningError) as caught:
            apply_changes(TuningModel(), {name: value})
        assert [error.field for error in caught.value.errors] == [name]
        assert caught.value.errors[0].allowed


def test_option_is_ramped_into_force_and_kept(installed):
    installed(PLUG_IN)
    now = iter(range(0, 1000, 10))
    book = TuningBook(
        MACHINE, lambda: float(next(now)), None, lambda new, old: made.append(
            make_with(MACHINE, PERIOD, new, old))
    )  # fmt: skip
    made = []
    changes = {"algorithm": "soft", "soft_push": 2.0}
    assert book.answer({"op": "tune", "if_version": 1, "changes": changes})["ok"]
    homes = frozen(np.stack((np.zeros(6), MACHINE.parked_pose)))
    thinker = Thinker(MACHINE, book.tuning, PERIOD, homes, made[-1])
    assert thinker.cueing.push == 2.0
    assert book.answer({"op": "tune", "if_version": 2, "changes": {"soft_push": 1.0}})["ok"]
    thinker.retune(book.tuning)
    for _ in range(30):
        thinker.ramp()
    assert thinker.cueing.push == pytest.approx(1.5, abs=0.11)
    thinker.settle()
    assert thinker.cueing.push == 1.0
    assert book.model.showing(thinker.in_force) == book.model.values()
    again = TuningBook.from_mapping(book.to_mapping(), MACHINE, lambda: 0.0)
    assert again.model.values()["soft_push"] == 1.0


def test_option_with_which_it_cannot_be_made_is_refused_by_name(installed):
    installed(PLUG_IN)
    soft = apply_changes(default_for(MACHINE), {"algorithm": "soft"})
    make_with(MACHINE, PERIOD, soft)
    with pytest.raises(TuningError) as caught:
        make_with(MACHINE, PERIOD, apply_changes(soft, {"soft_shape": "square"}), soft)
    (error,) = caught.value.errors
    assert (error.field, error.value) == ("soft_shape", "square")
    assert "square is not built yet" in error.message


def test_option_of_another_algorithm_is_refused_naming_its_own(installed, tmp_path):
    installed(PLUG_IN)
    tuner = World(tmp_path).client("tuner")
    answer = tuner.patch("/api/tuning", json={"soft_push": 1.0}, headers={"if-match": '"1"'})
    assert answer.status_code == 422
    assert "read by soft" in answer.json()["details"][0]["message"]
    both = {"algorithm": "soft", "soft_push": 1.0}
    assert tuner.put("/api/presets/mine", json=both).status_code == 201
    assert tuner.get("/api/presets/mine").json()["values"]["soft_push"] == 1.0
    values = tuner.patch("/api/tuning", json=both, headers={"if-match": '"1"'}).json()["values"]
    assert (values["algorithm"], values["soft_push"]) == ("soft", 1.0)


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        ("class Options(BaseModel):\n    push: float = 0.5", "push has no bounds"),
        ("class Options(BaseModel):\n    push: float = Field(ge=0.0, le=1.0)", "push"),
        ("class Options(BaseModel):\n    push: str = 'any'", "push"),
        ("class Options:\n    push = 0.5", "cannot be tuned"),
    ],
)
def test_options_that_no_page_could_show_refuse_the_plug_in(installed, options, reason):
    head, tail = PLUG_IN.split("class Options(BaseModel):")
    installed(f"{head}\n{options}\n\nclass Soft{tail.split('class Soft')[1]}")
    describe(MACHINE)
    soft = apply_changes(default_for(MACHINE), {"algorithm": "soft"})
    with pytest.raises(TuningError, match=reason):
        make_with(MACHINE, PERIOD, soft)


@pytest.mark.parametrize("text", ["raise ImportError('no such library')", "Hard = 1"])
def test_plug_in_that_does_not_load_is_refused_and_hurts_nobody(installed, text):
    installed(text)
    assert [f for f in describe(MACHINE) if f["name"].startswith("soft_")] == []
    soft = apply_changes(default_for(MACHINE), {"algorithm": "soft"})
    with pytest.raises(TuningError) as caught:
        make_with(MACHINE, PERIOD, soft)
    assert caught.value.errors[0].field == "algorithm"
    assert "does not load" in caught.value.errors[0].message


def test_kept_options_of_a_plug_in_that_is_gone_are_left_out(installed, monkeypatch):
    module = installed(PLUG_IN)
    model = apply_changes(default_for(MACHINE), {"soft_push": 2.0, "scale": 0.3})
    kept = {"version": 4, "values": model.values(), "former": []}
    monkeypatch.undo()
    sys.modules.pop(module, None)
    registry._plugins.cache_clear()
    book = TuningBook.from_mapping(kept, MACHINE, lambda: 0.0)
    assert book.model.scale == 0.3
    assert any("soft_push" in warning for warning in book.warnings)
