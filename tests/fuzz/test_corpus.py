"""Every decoder against its oracle: the corpus, and some thousand mutations of it by fixed seeds.

The campaign of ten million packets and the search with atheris: see README.md in this folder.
"""

import logging

import pytest
from mutate import Mutator
from targets import CORPUS, TARGETS

# so many mutations; the dear targets get fewer
COUNT = {"config": 60, "machine": 60, "preset": 150, "command": 300, "mapped": 1000, "request": 800}


@pytest.fixture(autouse=True)
def _quiet():
    logging.disable()
    yield
    logging.disable(logging.NOTSET)


def test_every_corpus_belongs_to_a_target():
    assert {folder.name for folder in CORPUS.iterdir()} == set(TARGETS)
    sizes = [path.stat().st_size for path in CORPUS.rglob("*") if path.is_file()]
    assert len(sizes) < 500
    assert sum(sizes) < 300_000


@pytest.mark.parametrize("target", TARGETS.values(), ids=lambda target: target.name)
def test_corpus(target):
    taken = set()
    for name, data in target.corpus():
        try:
            taken.add(target.check(data))
        except Exception as error:
            raise AssertionError(f"{target.name}: {name}") from error
    assert taken == {True, False}, "the corpus must hold both what is taken and what is refused"


@pytest.mark.parametrize("target", TARGETS.values(), ids=lambda target: target.name)
def test_mutations(target):
    mutator = Mutator(target.shape, [data for _, data in target.corpus()], target.name)
    for _ in range(COUNT.get(target.name, 2000)):
        data = mutator.draw()
        try:
            target.check(data)
        except Exception as error:
            raise AssertionError(f"{target.name}: {data.hex()}") from error
