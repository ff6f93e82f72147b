"""The page in a real browser, against the real server process, over the real request sockets."""

import itertools
import os
import socket
import subprocess
import sys
import threading
import urllib.error
import urllib.request
from pathlib import Path

import pytest
from browser.chromium import IN_CHROMIUM
from browser.scene import TOKENS, Peers, Scene, t2_compact, write_configuration

from motionserver.settings.tuning import default_for
from motionserver.settings.tuning_scope import names_of

ROOT = Path(__file__).parents[2]

pytestmark = IN_CHROMIUM


class Site:
    """A server process with a scene behind it."""

    def __init__(self, folder, **config):
        with socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))
            self.port = probe.getsockname()[1]
        machine = t2_compact()
        self.url = f"http://127.0.0.1:{self.port}/"
        self.scene = Scene(machine)
        self.configuration = write_configuration(folder, self.port, machine, **config)
        self.process = None

    def start(self):
        path = os.pathsep.join(str(ROOT / part) for part in ("", "protocol", "clients"))
        command = [sys.executable, "-m", "motionserver.web", str(self.configuration)]
        self.process = subprocess.Popen(command, env=os.environ | {"PYTHONPATH": path})
        pause = threading.Event()
        for _ in range(600):
            try:
                with urllib.request.urlopen(self.url + "healthz", timeout=1):
                    return
            except (urllib.error.URLError, ConnectionError):
                pause.wait(0.05)
        raise AssertionError("the server did not answer in 30 s")

    def stop(self):
        if self.process is not None:
            self.process.terminate()
            self.process.wait(15)
            self.process = None


@pytest.fixture
def site(tmp_path):
    place = Site(tmp_path)
    with Peers(tmp_path, place.scene):
        place.start()
        yield place
        place.stop()


class Visit:
    """A page and everything it complained about."""

    def __init__(self, browser, site, width=1440, height=900):
        self.complaints = []
        self.page = browser.new_page(viewport={"width": width, "height": height})
        self.page.set_default_timeout(15000)
        self.page.on("pageerror", lambda error: self.complaints.append(str(error)))
        self.page.on("dialog", lambda dialog: self.complaints.append(dialog.message))
        self.page.on("console", self.listen)
        self.page.goto(site.url)

    def listen(self, message):
        if "Security Policy" in message.text or "Uncaught" in message.text:
            self.complaints.append(message.text)

    def identify(self, role):
        self.page.fill("#token", TOKENS[role])
        self.page.click("#token-use")
        self.expect("#role", role)

    def expect(self, selector, text):
        self.page.wait_for_function(
            "([s, t]) => document.querySelector(s)?.textContent.includes(t)", arg=[selector, text]
        )

    def value(self, name):
        return self.page.input_value(f"#tune-{name}")


@pytest.fixture
def visit(chromium, site):
    visits = []

    def open_page(**size):
        visits.append(Visit(chromium, site, **size))
        return visits[-1]

    yield open_page
    for one in visits:
        one.page.close()
        assert one.complaints == []


def test_operator_engages_tunes_undoes_and_parks(site, visit):
    one = visit()
    one.expect("#state", "PARKED")
    assert one.page.is_disabled("#engage")
    assert one.page.is_disabled("#park")
    one.identify("operator")
    one.page.click("#engage:enabled")
    one.expect("#state", "RUN")
    one.page.fill("#tune-scale", "0.4")
    one.page.fill("#tune-tilt_rate_deg_s", "6")
    one.expect("#apply", "Apply 2 changes")
    one.page.click("#apply")
    one.expect("#version", "version 2")
    assert (site.scene.book.model.scale, site.scene.book.model.tilt_rate_deg_s) == (0.4, 6.0)
    one.page.click("#undo:enabled")
    one.expect("#version", "version 3")
    assert site.scene.book.model.scale == 0.6
    assert one.value("scale") == "0.6"
    one.page.click("#park")
    one.expect("#state", "PARK")
    one.expect("#events", "park asked by http")


def test_viewer_may_look_and_park_but_not_tune(site, visit):
    one = visit()
    one.identify("viewer")
    one.page.fill("#tune-scale", "0.4")
    assert one.page.is_disabled("#apply")
    assert one.page.is_disabled("#engage")
    site.scene.put("RUN", "by hand")
    one.page.click("#park:enabled")
    one.expect("#answer", "park: accepted")


def test_wrong_values_and_stale_versions_are_explained_at_the_field(site, visit):
    one = visit()
    one.identify("tuner")
    one.page.fill("#tune-scale", "1.7")
    one.page.click("#apply:enabled")
    one.expect(".field.wrong .wrong-text", "allowed 0 to 1")
    assert site.scene.book.version == 1
    one.page.fill("#tune-scale", "0.5")
    book = site.scene.book
    book.answer({"op": "tune", "if_version": 1, "changes": {"horizon_s": 1.5}})
    one.page.click("#apply:enabled")
    one.expect("#tuning-answer", "version 2")
    assert book.model.scale == 0.6
    one.page.click("#apply:enabled")
    one.expect("#version", "version 3")
    assert book.model.scale == 0.5


def test_presets_are_saved_loaded_and_applied(site, visit):
    one = visit()
    one.identify("tuner")
    one.page.fill("#preset-name", "mine")
    one.page.click("#preset-save")
    one.expect("#tuning-answer", "Saved")
    one.page.select_option("#preset", "paper-2014")
    one.page.click("#preset-load")
    one.expect("#tuning-answer", "in the form")
    one.page.click("#apply:enabled")
    one.expect("#version", "version 2")
    assert site.scene.book.model.filters == "fig3"
    assert not site.scene.book.model.legs
    one.page.select_option("#preset", "mine")
    one.page.click("#preset-load")
    one.page.click("#apply:enabled")
    one.expect("#version", "version 3")
    assert site.scene.book.model.filters == "standard"


def test_another_engine_is_run_beside_and_takes_over(site, visit):
    one = visit()
    row = "#engines .engine:has(b:text-is('{}'))"
    drive, run = (row.format("classical") + f" .acts button:nth-child({n})" for n in (1, 2))
    one.expect("#side-keys", "classical")
    assert one.page.is_disabled(drive)
    one.identify("tuner")
    one.page.wait_for_selector(f"{drive}:enabled")
    assert one.page.is_disabled(run)
    one.identify("operator")
    one.page.click(f"{run}:enabled")
    one.expect("#engines-answer", "classical stopped")
    assert site.scene.beside == []
    one.page.wait_for_function("() => !document.querySelector('#side-keys').textContent")
    one.page.click(f"{run}:enabled")
    one.expect("#engines-answer", "classical runs beside")
    one.page.fill("#tune-scale", "0.4")
    one.page.click(f"{drive}:enabled")
    one.page.wait_for_selector("#engines .drives b:text-is('classical')")
    assert site.scene.book.model.algorithm == one.value("algorithm") == "classical"
    assert site.scene.book.model.scale == 0.6
    one.expect("#apply", "Apply 1 change")
    one.page.wait_for_selector(row.format("thondel2014") + " button:text-is('Run beside')")


def test_silence_is_said_and_ends_by_itself(site, visit):
    one = visit()
    one.expect("#link", "live")
    site.scene.dead.add("planner")
    one.expect("#banner", "planner has not reported")
    site.scene.dead.add("guard")
    one.expect("#banner", "guard has not reported")
    one.expect("#state", "UNKNOWN")
    site.scene.dead.clear()
    one.page.wait_for_selector("#banner", state="hidden")
    site.stop()
    one.expect("#banner", "What you see is old")
    assert one.page.evaluate("document.body.classList.contains('stale')")
    site.start()
    one.page.wait_for_selector("#banner", state="hidden")
    one.expect("#link", "live")


def test_a_page_older_than_its_planner_gets_its_forms_by_itself(site, visit):
    one = visit()
    absent = {"status": 503, "json": {"error": "the planner does not answer"}}
    for path in ("**/api/tuning", "**/api/side"):
        one.page.route(path, lambda route: route.fulfill(**absent))
    one.page.reload()
    one.expect("#tuning-answer", "the planner does not answer")
    one.page.unroute_all()
    one.page.wait_for_selector("#engines .engine")
    one.page.wait_for_selector("#tune-scale", state="attached")
    one.expect("#version", "version 1")
    assert one.value("scale") == "0.6"


def test_dragging_ends_when_the_browser_takes_the_pointer(site, visit):
    one = visit()
    one.expect("#link", "live")
    assert one.page.evaluate(
        """() => {
          const canvas = document.getElementById("hexapod");
          let taken = 0;
          canvas.setPointerCapture = () => { taken += 1; };
          const send = (type, x) => canvas.dispatchEvent(
            new PointerEvent(type, { pointerId: 1, clientX: x, clientY: 0 }));
          const seen = [];
          const context = canvas.getContext("2d");
          return import("/static/hexapod.js").then(({ Hexapod }) => {
            const view = new Hexapod(canvas);
            send("pointerdown", 0);
            send("pointermove", 10);
            seen.push(view.turn);
            send("lostpointercapture", 10);
            send("pointermove", 50);
            seen.push(view.turn);
            return taken > 0 && seen[0] < 0.5 && seen[1] === seen[0];
          });
        }"""
    )


def test_hostile_text_is_shown_as_text(site, visit):
    hostile = "<img src=x onerror=alert(1)><script>alert(2)</script>"
    site.scene.put("PARKED", hostile)
    one = visit()
    one.expect("#reason", hostile)
    one.expect("#events", hostile)
    assert one.page.evaluate("document.querySelectorAll('main img, main script').length") == 0


@pytest.mark.parametrize(("width", "height"), [(1440, 900), (390, 844)])
def test_page_fits_and_everything_is_drawn(site, visit, tmp_path, width, height):
    site.scene.put("RUN", "source 10.0.0.12:40312 is fresh")
    one = visit(width=width, height=height)
    one.expect("#forces", "felt")
    one.page.wait_for_function(
        """() => [...document.querySelectorAll("canvas")].length === 10 &&
          [...document.querySelectorAll("canvas")].every((c) => {
            const data = c.getContext("2d").getImageData(0, 0, c.width, c.height).data;
            return data.some((v) => v > 0);
          })"""
    )
    assert one.page.evaluate("document.documentElement.scrollWidth") <= width
    assert one.page.evaluate("performance.getEntriesByType('resource').every("
                             "(r) => r.name.startsWith(location.origin))")  # fmt: skip
    one.page.screenshot(path=tmp_path / f"page-{width}.png", full_page=True)


def shown_fields(one):
    script = (
        "[...document.querySelectorAll('.field')].filter((f) => f.offsetParent)"
        ".map((f) => f.querySelector('input, select').id.slice(5))"
    )
    return set(one.page.evaluate(script))


def test_form_shows_the_tunables_of_the_algorithm(site, visit):
    one = visit()
    one.identify("tuner")
    one.expect("#version", "version 1")
    assert shown_fields(one) == set(names_of("mpc"))
    one.page.select_option("#tune-algorithm", "classical")
    assert shown_fields(one) == set(names_of("classical"))
    one.page.fill("#tune-gain", "0.4")
    one.page.click("#apply:enabled")
    one.expect("#version", "version 2")
    assert (site.scene.book.model.algorithm, site.scene.book.model.gain) == ("classical", 0.4)
    one.page.select_option("#tune-algorithm", "mpc")
    one.page.click("#apply:enabled")
    one.expect("#version", "version 3")
    assert shown_fields(one) == set(names_of("mpc"))


def test_what_is_not_in_force_as_asked_for_is_marked(site, visit):
    one = visit()
    one.expect("#version", "version 1")
    assert not one.page.is_visible("#tuning-notice")
    site.scene.stuck = {"scale": 0.35, "backend": "piqp", "gain": 0.1}
    site.scene.fallback = "Version 7 of the tuning cannot be used."
    one.expect("#tuning-notice", "2 values are not in force")
    one.expect("#tuning-notice", "Version 7")
    one.expect(".field:has(#tune-backend) .force-text", "in force: piqp, asked for: daqp")
    one.expect(".field:has(#tune-scale) .force-text", "in force: 0.35, asked for: 0.6")
    site.scene.stuck, site.scene.fallback, site.scene.is_ramping = {}, "", True
    one.page.wait_for_selector("#ramp", state="visible")
    assert not one.page.is_visible("#tuning-notice")


def test_list_of_presets_names_the_one_that_is_asked_for(site, visit):
    def choice_becomes(name):
        one.page.wait_for_function(
            "(name) => document.querySelector('#preset').selectedOptions[0]?.textContent === name",
            arg=name,
        )

    def load(name):
        one.page.select_option("#preset", name)
        one.page.click("#preset-load")
        one.expect("#tuning-answer", f"Preset {name}")

    # many changes in a second of the wall clock
    site.scene.book._now = itertools.count(0, 10).__next__
    one = visit()
    one.identify("tuner")
    one.expect("#version", "version 1")
    choice_becomes("default")
    load("paper-2014")
    one.page.click("#apply:enabled")
    one.expect("#version", "version 2")
    choice_becomes("paper-2014")
    load("passive-3deg")
    one.page.click("#apply:enabled")
    one.expect("#version", "version 3")
    choice_becomes("passive-3deg")
    assert site.scene.book.model == default_for(site.scene.machine)
    one.page.fill("#tune-scale", "0.5")
    one.page.click("#apply:enabled")
    one.expect("#version", "version 4")
    choice_becomes("modified from passive-3deg")
    one.page.fill("#tune-scale", "0.6")
    one.page.click("#apply:enabled")
    one.expect("#version", "version 5")
    choice_becomes("passive-3deg")


def test_saved_preset_holds_what_the_form_shows(site, visit):
    one = visit()
    one.identify("tuner")
    one.expect("#version", "version 1")
    one.page.fill("#tune-scale", "0.45")
    one.page.fill("#preset-name", "mine")
    one.page.click("#preset-save")
    one.expect("#tuning-answer", "Saved the form as mine, 1 value of it not applied yet")
    assert site.scene.book.version == 1
    one.page.click("#discard")
    one.page.select_option("#preset", "mine")
    one.page.click("#preset-load")
    one.expect("#tuning-answer", "in the form")
    assert one.value("scale") == "0.45"


def test_card_of_limits_shows_the_box_only_where_it_is_one(site, visit):
    one = visit()
    one.identify("operator")
    one.page.click("#engage:enabled")
    one.expect("#state", "RUN")
    plot = "#xmax .plot:nth-child({}) p"
    for number in (1, 2, 3):
        one.expect(plot.format(number), "legs decide")
    one.expect(plot.format(4), "±")
    one.expect("#shares", "leg length")
    site.scene.book.answer({"op": "tune", "if_version": 1, "changes": {"algorithm": "thondel2014"}})
    one.expect(plot.format(1), "±")
