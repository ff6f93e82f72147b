"""Machines made of real files below a temporary root."""

from collections.abc import Callable, Mapping
from pathlib import Path

import pytest

from motionserver.doctor.tree import Tree

Plant = Callable[[Mapping[str, str]], Tree]


@pytest.fixture
def plant(tmp_path: Path) -> Plant:
    def grow(files: Mapping[str, str]) -> Tree:
        for path, text in files.items():
            place = tmp_path / path.lstrip("/")
            place.parent.mkdir(parents=True, exist_ok=True)
            place.write_text(text, "utf-8")
        return Tree(tmp_path)

    return grow
