"""Presets are whole states; what has no effect is refused, and files of old are read."""

import pytest
from web_world import MACHINE, World

from motionserver.settings.tuning import default_for
from motionserver.settings.tuning_presets import PresetShelf
from motionserver.settings.tuning_scope import names_of


@pytest.fixture
def world(tmp_path):
    return World(tmp_path)


def apply(world, name):
    client = world.client("tuner")
    values = client.get(f"/api/presets/{name}").json()["values"]
    version = client.get("/api/tuning").json()["version"]
    answer = client.patch("/api/tuning", json=values, headers={"if-match": f'"{version}"'})
    assert answer.status_code == 200, answer.json()
    return answer.json()["values"], values


def test_default_is_a_preset_and_is_that_of_a_fresh_installation(world):
    values = world.client().get("/api/presets/default").json()["values"]
    assert values == default_for(MACHINE).values()


def test_preset_that_is_applied_leaves_nothing_of_the_one_before(world):
    names = [p["name"] for p in world.client().get("/api/presets").json()["presets"]]
    assert {"default", "gentle", "paper-2014", "passive-3deg", "active-driver-6deg"} <= set(names)
    for first in names:
        for second in names:
            apply(world, first)
            got, asked = apply(world, second)
            assert got == asked, (first, second)
    world.scene.book.answer({"op": "tune", "if_version": world.scene.book.version, "changes":
                             {"mpc_trust_s": 3.0, "perception": "reid-nahon"}})  # fmt: skip
    assert apply(world, "default")[0] == default_for(MACHINE).values()


@pytest.mark.parametrize(
    "name", ["default", "gentle", "paper-2014", "passive-3deg", "active-driver-6deg"]
)
def test_shipped_preset_sets_nothing_that_its_algorithm_does_not_read(tmp_path, name):
    preset = PresetShelf(tmp_path).read(name)
    assert set(preset.values) <= set(names_of(preset.values["algorithm"]))
    model, warnings = preset.whole(MACHINE)
    assert warnings == ()
    assert model.algorithm == preset.values["algorithm"]


def test_value_without_effect_is_not_saved(world):
    answer = world.client("tuner").put("/api/presets/mine", json={"gain": 0.3})
    assert answer.status_code == 422
    (detail,) = answer.json()["details"]
    assert "has no effect with mpc; read by classical" in detail["message"]
    both = {"algorithm": "classical", "gain": 0.3}
    saved = world.client("tuner").put("/api/presets/mine", json=both)
    assert saved.status_code == 201
    assert saved.json()["values"] == default_for(MACHINE).values() | both


def test_removed_tunable_is_refused_saying_so(world):
    tuner = world.client("tuner")
    body = {"translation_threshold_m_s2": 0.2}
    for answer in (
        tuner.put("/api/presets/mine", json=body),
        tuner.patch("/api/tuning", json=body, headers={"if-match": '"1"'}),
    ):
        assert answer.status_code == 422
        assert "removed" in answer.json()["details"][0]["message"]


def test_change_without_effect_is_refused_naming_the_algorithms_that_read_it(world):
    tuner = world.client("tuner")
    answer = tuner.patch("/api/tuning", json={"halving": "off"}, headers={"if-match": '"1"'})
    assert answer.status_code == 422
    (detail,) = answer.json()["details"]
    assert (detail["field"], "thondel2014" in detail["allowed"]) == ("halving", True)
    assert world.scene.book.version == 1


def test_saved_preset_of_an_earlier_version_is_read_with_warnings(world):
    folder = world.config.presets_dir
    folder.mkdir()
    (folder / "old.toml").write_text(
        'about = "of old"\n[values]\nscale = 0.4\ngain = 0.2\ntranslation_threshold_m_s2 = 0.3\n'
    )
    found = world.client().get("/api/presets/old").json()
    assert found["values"] == default_for(MACHINE).values() | {"scale": 0.4}
    assert len(found["warnings"]) == 2
    assert any("translation_threshold_m_s2" in text for text in found["warnings"])
    assert any("gain" in text for text in found["warnings"])
    assert "old" in [p["name"] for p in world.client().get("/api/presets").json()["presets"]]
    apply(world, "old")
    assert world.scene.book.model.scale == 0.4


def test_tuning_tells_what_is_in_force_and_who_reads_a_tunable(world):
    world.scene.stuck = {"scale": 0.35}
    told = world.client().get("/api/tuning").json()
    assert (told["values"]["scale"], told["in_force"]["scale"]) == (0.6, 0.35)
    assert told["is_ramping"] is False
    fields = {field["name"]: field["algorithms"] for field in told["fields"]}
    assert fields["gain"] == ["classical"]
    assert set(fields["scale"]) >= {"mpc", "classical", "thondel2014"}
    assert all(fields.values())
