"""The annotated configuration: complete, true to the model's defaults, every key explained."""

import re
import tomllib
from pathlib import Path

import pytest
from pydantic import BaseModel

from motionserver.settings.config import PREFIX, Config, load_config

FILE = Path(__file__).parents[2] / "deploy" / "motionserver.toml"
OPTIONAL = re.compile(r"^# (?=(length_offset_m|head_m) = )", re.MULTILINE)


def sections():
    for name, item in Config.model_fields.items():
        model = item.annotation
        if not isinstance(model, type) or not issubclass(model, BaseModel):
            (model,) = model.__args__
        yield name, model


def text_of(name):
    """Lines of one section, up to the next header."""
    text = FILE.read_text("utf-8")
    begin = re.search(rf"^\[+{name}\]+$", text, re.MULTILINE).end()
    after = re.search(r"^\[", text[begin:], re.MULTILINE)
    return text[begin : begin + after.start() if after else len(text)]


def about(name, key):
    """The comment above a key."""
    comments: list[str] = []
    for line in text_of(name).splitlines():
        if re.match(rf"^(# )?{key} = ", line):
            return " ".join(comments)
        comments = [*comments, line.lstrip("# ")] if line.startswith("#") else []
    raise AssertionError(f"{name}.{key} does not stand in {FILE.name}")


@pytest.fixture(autouse=True)
def _no_environment(monkeypatch):
    import os

    for name in list(os.environ):
        if name.startswith(PREFIX):
            monkeypatch.delenv(name)


def test_it_says_what_happens_without_it():
    assert load_config(FILE) == load_config(None)


def test_every_key_of_the_model_stands_in_it_and_no_other():
    found = tomllib.loads(OPTIONAL.sub("", FILE.read_text("utf-8")))
    assert set(found) == set(Config.model_fields)
    for name, model in sections():
        section = found[name][0] if isinstance(found[name], list) else found[name]
        assert set(section) == set(model.model_fields), name


def test_keys_without_a_default_are_valid_as_shown(tmp_path):
    path = tmp_path / "all.toml"
    path.write_text(OPTIONAL.sub("", FILE.read_text("utf-8")), "utf-8")
    config = load_config(path)
    assert config.platform.length_offset_m is not None
    assert config.platform.head_m is not None


@pytest.mark.parametrize(
    ("name", "key", "item"),
    [
        (name, key, item)
        for name, model in sections()
        for key, item in model.model_fields.items()
        if key != "tuning"
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_every_key_is_explained_with_default_and_range(name, key, item):
    comment = about(name, key)
    assert len(comment) > 20
    assert "Default" in comment
    numbers = [part for part in item.metadata if hasattr(part, "ge")]
    low = next((float(part.ge) for part in item.metadata if hasattr(part, "ge")), None)
    high = next((float(part.le) for part in item.metadata if hasattr(part, "le")), None)
    if numbers:
        assert f"{low:g} to {high:g}" in comment
    if key.endswith("_m"):
        assert "[m]" in comment
    if key.endswith("_hz"):
        assert "[Hz]" in comment
    if key.endswith("_ms"):
        assert "[ms]" in comment
