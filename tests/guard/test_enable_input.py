import pytest
from guard_scenes import bench

from motionserver.guard.loop import as_request


@pytest.mark.parametrize(
    ("text", "enabled"), [("1\n", True), ("0\n", False), ("", False), ("11", False)]
)
def test_the_enable_input_is_read_at_each_engage(tmp_path, text, enabled):
    switch = tmp_path / "value"
    switch.write_text(text)
    assert as_request({"op": "engage", "by": "http"}, switch).enabled is enabled


def test_an_enable_input_that_cannot_be_read_is_open(tmp_path):
    assert not as_request({"op": "engage", "by": "http"}, tmp_path / "missing").enabled


def test_without_an_enable_input_nothing_is_asked_of_it(tmp_path):
    assert as_request({"op": "engage", "by": "http"}, None).enabled
    assert as_request({"op": "park", "by": "http"}, tmp_path / "missing").enabled


def test_an_open_enable_input_keeps_the_page_from_engaging():
    b = bench(engage="http")
    b.until("PARKED", 1.0)
    b.run(0.2)
    b.enabled = False
    assert "enable input is open" in b.tick("engage", by="http")[0]
    assert b.state == "PARKED"
    b.enabled = True
    assert b.tick("engage", by="http") == ("",)
    assert b.state == "RAISING"
