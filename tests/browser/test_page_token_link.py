"""The link that `demo` and `run` print: it gives its rights, and leaves nothing behind."""

import pytest
from browser.chromium import IN_CHROMIUM
from browser.scene import TOKENS, Peers
from browser.test_page import Site

from motionserver.cli.page_link import page_link

pytestmark = IN_CHROMIUM


@pytest.fixture
def site(tmp_path):
    place = Site(tmp_path)
    with Peers(tmp_path, place.scene):
        place.start()
        yield place
        place.stop()


@pytest.fixture
def page(chromium):
    made = chromium.new_page()
    made.set_default_timeout(15000)
    yield made
    made.close()


def link_of(site, token):
    return page_link(site.url.rstrip("/"), token)


def expect(page, selector, text):
    page.wait_for_function(
        "([s, t]) => document.querySelector(s)?.textContent.includes(t)", arg=[selector, text]
    )


def test_a_link_with_the_operators_token_gives_its_rights_and_a_clean_address(site, page):
    asked = []
    page.on("request", lambda request: asked.append(request.url))
    said = []
    page.on("console", lambda message: said.append(message.text))
    page.goto(link_of(site, TOKENS["operator"]))
    expect(page, "#role", "operator")
    expect(page, "#state", "PARKED")
    assert page.evaluate("location.href") == page.url == site.url
    assert page.input_value("#token") == ""
    page.click("#engage:enabled")
    expect(page, "#state", "RUN")
    assert asked
    assert not any(TOKENS["operator"] in url for url in (*asked, *said))
    # kept for this tab only, as a token that was typed
    page.reload()
    expect(page, "#role", "operator")
    assert page.evaluate("[localStorage.length, document.cookie]") == [0, ""]


def test_a_link_opened_in_a_tab_that_shows_the_page_is_taken_over(site, page):
    page.goto(site.url)
    expect(page, "#role", "viewer")
    page.evaluate("link => { location.href = link }", link_of(site, TOKENS["tuner"]))
    expect(page, "#role", "tuner")
    assert page.evaluate("location.href") == site.url


def test_a_link_with_a_wrong_token_is_told_and_leaves_a_clean_address(site, page):
    page.goto(link_of(site, "x" * 40))
    expect(page, "#role", "unknown")
    assert page.evaluate("location.href") == site.url


def test_signs_that_a_link_must_escape_arrive_as_they_are(site, page):
    odd = "a+b/c=d&e#f%20" + "0123456789" * 3
    with page.expect_request("**/api/status") as asked:
        page.goto(link_of(site, odd))
    assert asked.value.headers["authorization"] == f"Bearer {odd}"
    page.wait_for_selector("#role.bad")


def test_another_fragment_is_left_alone(site, page):
    page.goto(site.url + "#tuning")
    expect(page, "#role", "viewer")
    assert page.evaluate("location.hash") == "#tuning"
