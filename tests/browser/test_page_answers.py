"""What the page says when something is not possible, and in a fault, in a real browser."""

import gzip
import json

import pytest
from browser.chromium import IN_CHROMIUM
from browser.scene import TOKENS, Peers
from browser.test_page import Site, Visit

pytestmark = IN_CHROMIUM
DUMP = "20261130T120000.000Z-fault.json.gz"


@pytest.fixture
def site(tmp_path):
    box = tmp_path / "blackbox"
    box.mkdir()
    place = Site(tmp_path, blackbox_dir=str(box))
    with Peers(tmp_path, place.scene):
        place.start()
        yield place
        place.stop()


@pytest.fixture
def one(chromium, site):
    visit = Visit(chromium, site)
    yield visit
    visit.page.close()
    assert visit.complaints == []


def use(one, token):
    one.page.fill("#token", token)
    one.page.click("#token-use")


def test_unknown_token_is_named_and_the_page_stays_a_viewers(site, one):
    one.expect("#link", "live")
    use(one, "x" * 43)
    one.expect("#role", "token unknown")
    one.expect("#answer", "The token is not known here")
    one.expect("#link", "live")
    site.scene.put("HOLD", "something new happened")
    one.expect("#reason", "something new happened")
    assert not one.page.evaluate("document.body.classList.contains('stale')")
    # it was not kept: the next look is a viewer's again
    one.page.reload()
    one.expect("#role", "viewer")
    one.identify("operator")
    one.page.wait_for_selector("#engage:not([disabled]), #engage[title]")


def test_fault_says_what_to_do_and_hands_out_the_dump(site, one, tmp_path):
    one.expect("#link", "live")
    assert one.page.is_hidden("#help")
    site.scene.put("FAULT", "no feedback from the device for 104 ms")
    one.expect("#help-steps", "an operator presses Reset")
    assert one.page.is_hidden("#dump")
    inside = gzip.compress(json.dumps({"format": "motionserver blackbox 1"}).encode())
    (tmp_path / "blackbox" / DUMP).write_bytes(inside)
    (tmp_path / "blackbox" / "secret.txt").write_text("not a dump")
    one.expect("#dump", DUMP)
    with one.page.expect_download() as download:
        one.page.click("#dump")
    assert download.value.suggested_filename == DUMP
    assert download.value.path().read_bytes() == inside
    one.expect("#dump-answer", "motionserver blackbox show")
    site.scene.put("PARKED", "parked")
    one.page.wait_for_selector("#help", state="hidden")


def test_refusal_shows_its_details(site, one):
    one.identify("tuner")
    one.page.fill("#tune-scale", "1.7")
    one.page.click("#apply:enabled")
    one.expect("#tuning-answer", "scale")
    one.expect("#tuning-answer", "allowed 0 to 1")


def test_nothing_to_undo_is_one_sentence(site, one):
    one.identify("tuner")
    said = one.page.evaluate(
        """async (token) => {
          const { send, sentence } = await import("/static/api.js");
          const answer = await send("POST", "/api/tuning/undo", { ifMatch: 1 });
          return [answer.status, sentence(answer.body)];
        }""",
        TOKENS["tuner"],
    )
    assert said == [409, "nothing to undo"]
