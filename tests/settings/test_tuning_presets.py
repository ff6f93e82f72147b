import pytest

from motionserver.settings.fields import TuningError
from motionserver.settings.tuning_presets import MOST_SAVED, PresetShelf


def test_saved_preset_is_read_back_and_listed(tmp_path):
    shelf = PresetShelf(tmp_path / "made-on-demand")
    shelf.save("mine-1", "note", {"scale": 0.5, "legs": False, "filters": "fig3"})
    preset = shelf.read("mine-1")
    assert preset.values == {"scale": 0.5, "legs": False, "filters": "fig3"}
    assert not preset.built_in
    assert shelf.names()[-1] == "mine-1"
    assert shelf.read("paper-2014").built_in
    assert [p.suffix for p in (tmp_path / "made-on-demand").iterdir()] == [".toml"]


@pytest.mark.parametrize("name", ["", "..", "../x", "a/b", "A", "a.b", "a" * 41, "a\n", "ä", "\0"])
def test_names_cannot_leave_the_directory(tmp_path, name):
    shelf = PresetShelf(tmp_path / "in")
    with pytest.raises(TuningError):
        shelf.save(name, "", {"scale": 0.5})
    with pytest.raises(KeyError):
        shelf.read(name)
    assert list(tmp_path.iterdir()) == []


def test_built_in_presets_cannot_be_replaced(tmp_path):
    with pytest.raises(TuningError):
        PresetShelf(tmp_path).save("gentle", "", {"scale": 0.5})


def test_bad_values_are_not_saved(tmp_path):
    with pytest.raises(TuningError):
        PresetShelf(tmp_path).save("bad", "", {"scale": 5.0})
    assert list(tmp_path.iterdir()) == []


def test_number_of_saved_presets_is_bounded(tmp_path):
    shelf = PresetShelf(tmp_path)
    for number in range(MOST_SAVED):
        (tmp_path / f"p{number}.toml").write_text("[values]\n")
    with pytest.raises(TuningError):
        shelf.save("one-more", "", {})
    shelf.save("p1", "", {"scale": 0.2})


@pytest.mark.parametrize(
    "text",
    [
        "{",
        "values = 3",
        "about = 1\n[values]\n",
        "[values]\nscale=7",
        "a = " + "[" * 3000,
        "[values]\nscale = " + "9" * 5000,
    ],
)
def test_a_broken_file_is_named(tmp_path, text):
    (tmp_path / "broken.toml").write_text(text)
    with pytest.raises(TuningError):
        PresetShelf(tmp_path).read("broken")
