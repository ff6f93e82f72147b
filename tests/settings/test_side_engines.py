"""Names of engines: refused in words, in the configuration and live."""

import pytest

from motionserver.errors import ConfigError
from motionserver.settings.config import load_config
from motionserver.settings.fields import TuningError
from motionserver.settings.resolve import resolve
from motionserver.settings.side_engines import side_names
from motionserver.settings.tuning_book import TuningBook

BAD = [["magic"], ["classical", "classical"], ["mpc2", 7, None]]


def test_names_keep_their_order():
    assert side_names(["thondel2014", "classical"]) == ("thondel2014", "classical")
    assert side_names([]) == ()


@pytest.mark.parametrize("value", [*BAD, "classical", 7, None, {"classical": 1}, [["classical"]]])
def test_what_is_no_list_of_names_is_refused(value):
    with pytest.raises(TuningError) as caught:
        side_names(value)
    assert all("classical" in error.allowed for error in caught.value.errors)


def test_the_configuration_names_key_and_what_is_allowed(tmp_path):
    def resolved(names):
        config = load_config(None, {"planner": {"side_engines": names}})
        return resolve(config, tmp_path)["planner"]["side_engines"]

    assert resolved(["classical"]) == ["classical"]
    with pytest.raises(ConfigError, match=r"\[planner\] side_engines: 'magic': no such algorithm.*"
                       r"Allowed: .*classical"):  # fmt: skip
        resolved(["magic"])
    with pytest.raises(ConfigError, match="'classical': there twice"):
        resolved(["classical", "classical"])


def test_a_tuning_that_cannot_be_used_is_taken_back(machine_book):
    book = machine_book
    book.answer({"op": "tune", "if_version": 1, "changes": {"scale": 0.3}})
    book.answer({"op": "tune", "if_version": 2, "changes": {"algorithm": "classical"}})
    refusal = book.take_back("classical cannot be made: broken")
    assert (refusal["ok"], refusal["kind"], refusal["version"]) == (False, "invalid", 4)
    assert (book.model.algorithm, book.model.scale) == ("mpc", 0.3)
    book.answer({"op": "undo", "if_version": 4})
    assert book.model.scale == 0.6
    # and after an undo that cannot be used
    book.take_back("broken")
    assert book.model.scale == 0.3


@pytest.fixture
def machine_book():
    from machines import compact

    clock = iter(range(0, 1000, 10))
    return TuningBook(compact(), lambda: float(next(clock)))
