"""Readers of what people write: configuration, machine, saved tuning.

Each target takes bytes, says whether they were taken, and raises when an invariant is broken.
"""

import atexit
import json
import math
import os
import shutil
import tempfile
import tomllib
from pathlib import Path

import numpy as np
from demand import must, words

from motionserver.core.limits import machine_from_mapping, machine_to_mapping
from motionserver.errors import ConfigError
from motionserver.settings.config import load_config, run_dir_of
from motionserver.settings.fields import TuningError
from motionserver.settings.machine import load_machine
from motionserver.settings.resolve import resolve
from motionserver.settings.tuning_presets import PresetShelf

# what may be set, by hand from the annotated example file
RANGES = (
    ("platform", "port", 1, 65535),
    ("platform", "local_port", 0, 65535),
    ("platform", "rate_hz", 20, 1000),
    ("platform", "length_offset_m", 0, 10),
    ("platform", "heave_neutral_m", -2, 2),
    ("cueing", "scale", 0, 1),
    ("cueing", "budget_ms", 1, 50),
    ("cueing", "rate_max_hz", 20, 200),
    ("web", "port", 0, 65535),
    ("server", "blackbox_kept", 0, 1000),
)
SECTIONS = {"server", "platform", "sources", "cueing", "planner", "operator", "web"}
_FOLDERS = []


def _written(data, name):
    if not _FOLDERS:
        _FOLDERS.append(Path(tempfile.mkdtemp(prefix="fuzz")))
        atexit.register(shutil.rmtree, _FOLDERS[0])
    path = _FOLDERS[0] / name
    descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
    os.write(descriptor, data)
    os.close(descriptor)
    return path


def config(data):
    """From the text of a file to what each process is told; only a ConfigError may come out."""
    path = _written(data, "server.toml")
    try:
        found = load_config(path)
        told = resolve(found, run_dir_of(found))
    except ConfigError as error:
        must(len(error.where) > 4, "no place is named")
        must(error.what, "nothing is said about what is wrong")
        must(error.do, "nothing is said about what to do")
        # what somebody typed may be shown, once or twice
        words(error, most=1000 + 4 * len(data))
        return False
    told_keys = tomllib.loads(path.read_text("utf-8"))
    assert set(told_keys) <= SECTIONS, "an unknown key is taken"
    for section, name, low, high in RANGES:
        value = getattr(getattr(found, section), name)
        assert value is None or low <= value <= high, f"{section}.{name} = {value}"
    assert sorted(found.platform.leg_order) == [0, 1, 2, 3, 4, 5]
    text = json.dumps(told, allow_nan=False)
    machine_from_mapping(json.loads(text)["machine"])
    for source in told["sources"]:
        assert 0 <= source["port"] <= 65535
        loopback = source["host"] in ("localhost", "::1") or source["host"].startswith("127.")
        allowed = source["key"] or any(one.allow_unsigned for one in found.sources)
        assert loopback or allowed or ":" in source["host"], "unsigned beyond loopback"
    return True


def machine(data):
    """From the text of a machine file to hard limits that are numbers."""
    path = _written(data, "machine.toml")
    try:
        with np.errstate(all="ignore"):
            found = load_machine(str(path))
    except ConfigError as error:
        words_of(error, path)
        return False
    assert 0 < found.leg_min < found.leg_max
    for name in ("leg_speed", "leg_acceleration", "leg_jerk", "joint_angle", "conditioning"):
        value = getattr(found, name)
        assert value is None or (math.isfinite(value) and value > 0), f"{name} = {value}"
    text = json.dumps(machine_to_mapping(found), allow_nan=False)
    assert machine_to_mapping(machine_from_mapping(json.loads(text))) == json.loads(text)
    for name in ("speed", "acceleration", "jerk"):
        pace, limit = getattr(found.pace, name), getattr(found, f"leg_{name}")
        assert limit is None or pace <= 0.9 * limit, f"a pace of {pace}, legs do {limit}"
    return True


def words_of(error, path):
    assert str(path) in error.where, f"{path} is not named in {error}"
    assert error.what
    assert error.do


def preset(data):
    """A tuning somebody saved."""
    path = _written(data, "saved.toml")
    try:
        found = PresetShelf(path.parent).read("saved")
    except TuningError as error:
        words(error, *(one.field for one in error.errors[:1]))
        return False
    assert len(found.about) <= 200
    for name, value in found.values.items():
        assert isinstance(value, (bool, str)) or math.isfinite(value), f"{name} = {value}"
    return True
