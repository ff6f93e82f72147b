from importlib.metadata import EntryPoint

import pytest

from motionserver.cueing import registry
from motionserver.cueing.classical import Classical
from motionserver.cueing.thondel import Thondel
from motionserver.cueing.tuning import Tuning


@pytest.mark.parametrize(("name", "cls"), [("classical", Classical), ("thondel2014", Thondel)])
def test_built_in(machine, name, cls):
    cueing = registry.make_cueing(machine, Tuning(algorithm=name), 0.01)
    assert isinstance(cueing, cls)
    assert cueing.name == name


def test_unknown_names_the_known(machine):
    with pytest.raises(ValueError, match="classical, thondel2014"):
        registry.make_cueing(machine, Tuning(algorithm="none"), 0.01)


def plugins(*entries):
    return lambda: [EntryPoint(name, value, registry.GROUP) for name, value in entries]


def test_plug_in(machine, monkeypatch):
    found = plugins(("mine", "motionserver.cueing.classical:Classical"))
    monkeypatch.setattr(registry, "_plugins", found)
    assert "mine" in registry.algorithms()
    assert registry.make_cueing(machine, Tuning(algorithm="mine"), 0.01).name == "classical"


def test_broken_plug_in_stops_with_its_name(machine, monkeypatch):
    monkeypatch.setattr(registry, "_plugins", plugins(("broken", "no_such_module:Thing")))
    with pytest.raises(ValueError, match="'broken'"):
        registry.make_cueing(machine, Tuning(algorithm="broken"), 0.01)
