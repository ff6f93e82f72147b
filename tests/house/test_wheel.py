"""The wheel holds what the installed server reads at run time."""

import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
DATA = {
    "motionserver": (".toml", ".html", ".js", ".css", ".svg", ".service", ".json5"),
    "motion_clients": (".csv",),
}


@pytest.fixture(scope="module")
def names(tmp_path_factory):
    builders = pytest.importorskip(
        "hatchling.builders.wheel", reason="hatchling is not installed: the wheel cannot be built"
    )
    folder = tmp_path_factory.mktemp("wheel")
    (built,) = builders.WheelBuilder(str(ROOT)).build(directory=str(folder))
    with zipfile.ZipFile(built) as wheel:
        return set(wheel.namelist())


def shipped(package, folder):
    for path in folder.rglob("*"):
        wanted = path.suffix in (".py", *DATA.get(package, ())) or path.name == "py.typed"
        if wanted and "__pycache__" not in path.parts:
            yield f"{package}/{path.relative_to(folder).as_posix()}"


@pytest.mark.parametrize(
    ("package", "folder"),
    [
        ("motionserver", "motionserver"),
        ("motion_protocol", "protocol/motion_protocol"),
        ("motion_clients", "clients/motion_clients"),
    ],
)
def test_every_file_of_a_package_is_in_it(names, package, folder):
    wanted = set(shipped(package, ROOT / folder))
    assert len(wanted) > 3
    assert wanted - names == set()


@pytest.mark.parametrize(
    ("where", "least"),
    [
        ("motionserver/web/static/", 10),
        ("motionserver/presets/platforms/", 1),
        ("motionserver/presets/tunings/", 4),
        ("motionserver/presets/deploy/", 2),
        ("motion_clients/recordings/", 7),
    ],
)
def test_pages_presets_and_recordings_are_in_it(names, where, least):
    assert sum(name.startswith(where) for name in names) >= least


def test_the_command_is_in_it_and_the_tests_are_not(names):
    assert any(name.endswith("entry_points.txt") for name in names)
    assert any("LICENSE" in name for name in names)
    tops = {name.partition("/")[0] for name in names if ".dist-info" not in name}
    assert tops == {"motionserver", "motion_protocol", "motion_clients"}
