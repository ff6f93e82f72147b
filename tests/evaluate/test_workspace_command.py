"""check: the table fits a terminal, the page is whole, warnings say what to do, files are told."""

import json
import re
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from machines import compact, science_fit
from typer.testing import CliRunner

from motionserver.cli.commands import app
from motionserver.core.axes import frozen
from motionserver.core.kinematics.reach import Ending, Limit
from motionserver.errors import ConfigError
from motionserver.evaluate.workspace.advice import advice, smallest_whole
from motionserver.evaluate.workspace.command import workspace_text
from motionserver.evaluate.workspace.draw import planes_file, printed
from motionserver.evaluate.workspace.page import to_html
from motionserver.evaluate.workspace.survey import survey
from motionserver.evaluate.workspace.table import to_text
from motionserver.evaluate.workspace.words import lopsided
from motionserver.settings.tuning import apply_changes, default_for
from motionserver.settings.tuning_presets import PresetShelf

PRESET = (
    Path(__file__).parents[2] / "motionserver" / "presets" / "platforms" / "t2-compact.toml"
).read_text("utf-8")


@pytest.fixture(scope="module")
def found():
    return survey(compact())


@pytest.fixture(scope="module")
def tall():
    return survey(science_fit())


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    folder = tmp_path_factory.mktemp("workspace")
    (folder / "c.toml").write_text(f'[server]\nstate_dir = "{folder}/state"\n')
    ended = run(
        str(folder / "c.toml"),
        *("--html", str(folder / "w.html")),
        *("--svg", str(folder / "w.svg")),
        *("--json", str(folder / "w.json")),
    )
    assert ended.exit_code == 0
    return folder, ended.stdout


def run(*words):
    return CliRunner().invoke(app, ["check", *words])


def test_check_keeps_what_it_said_and_adds_the_workspace(written):
    _, text = written
    for words in (": valid", "platform   moog", "machine    t2-compact", "planner    mpc"):
        assert words in text
    for words in ("surge    -0.199 m  legs 1 6 long", "+16.32 deg  legs 3 4 long", "warning: "):
        assert words in text
    assert re.search(r"tuned box +64 +30 +2 +0 +0 +0.21 +0.47", text)


@pytest.mark.parametrize("which", ["found", "tall"])
def test_table_fits_eighty_columns(which, request):
    one = request.getfixturevalue(which)
    text = to_text(one, advice(one, leg_rows=False, presets={"wild": 1.5 * one.box}))
    assert max(map(len, text.splitlines())) <= 80
    assert "nan" not in text


def test_asymmetry_is_said_in_words(tall):
    said = lopsided(tall.ranges[0])
    assert said == "surge reaches -0.249 m backwards but +0.198 m forwards: legs 3, 6 longest"
    assert lopsided(tall.ranges[1]) is None
    assert said in to_text(tall, ())


def test_page_needs_nothing_but_itself(written):
    folder, _ = written
    page = (folder / "w.html").read_text("utf-8")
    assert not re.search(r"(?:src|href)=|url\(|@import|https?://", page)
    assert page.count("<figure") == 15
    assert "nan" not in page
    for drawn in re.findall(r"<svg.*?</svg>", page, re.S):
        ElementTree.fromstring(drawn)
    assert "9.7%" in page
    assert "+-" not in page


def test_picture_is_a_file_of_its_own(written):
    folder, _ = written
    tree = ElementTree.parse(folder / "w.svg").getroot()
    names = {e.text for e in tree.iter() if e.get("class") == "name"}
    assert {"surge, pitch", "sway, roll", "pitch, yaw"} <= names
    edges = [e for e in tree.iter() if (e.get("class") or "").startswith("edge ")]
    assert {e.get("class").split()[1] for e in edges} == {"long", "short", "cond"}
    sizes = [float(v) for v in tree.get("viewBox").split()[2:]]
    for edge in edges:
        numbers = np.array(re.findall(r"-?\d+\.\d", edge.get("d")), dtype=float)
        assert numbers.min() >= 0.0
        assert numbers.max() <= 240.0 <= min(sizes)


def test_figures_as_json(written, found):
    folder, _ = written
    figures = json.loads((folder / "w.json").read_text("utf-8"))
    assert figures["digest"] == compact().digest
    assert figures["ranges"]["surge"]["high"] == pytest.approx(0.1979, abs=1e-4)
    assert figures["ranges"]["surge"]["high_ended_by"] == {"limit": "shortest", "legs": [1, 6]}
    assert figures["ranges"]["pitch"]["low_ended_by"] == {"limit": "conditioning", "legs": []}
    assert len(figures["planes"]) == 15
    assert np.array(figures["planes"]["surge-pitch"]["edge"]).shape == (72, 2)
    assert min(one["scale"] for one in figures["corners"]) == pytest.approx(smallest_whole(found))
    assert figures["warnings"][0]["do"].endswith(".")


def test_shipped_machine_has_but_the_known_warning(found):
    (only,) = advice(found)
    assert "no straight way" in only.what
    assert "workspace.parked.heave = -0.119" in only.do


def test_a_box_or_preset_beyond_the_reach_is_told_with_the_value_to_set(found):
    (wild, _) = advice(found, presets={"wild": compact().box * [1.2, 1, 1, 1, 1.1, 1]})
    assert "preset wild" in wild.what
    assert "surge 0.238 m, but 0.198 m is all forwards (legs 1, 6 shortest)" in wild.what
    assert "sway" not in wild.what
    assert "box_surge_m to at most 0.198 m, box_pitch_deg to at most 16.32 deg" in wild.do
    # the rounding of a data sheet is no mistake
    assert len(advice(found, presets={"rounded": compact().box * 1.005})) == 1


def test_a_head_far_above_is_told(tall):
    told = [one for one in advice(tall) if "head" in one.what]
    assert len(told) == 1
    assert "(0, 0, 1.2) m" in told[0].what
    assert "roll -7.04 deg to +7.04 deg" in told[0].what
    assert "yaw" not in told[0].what
    assert "about a head that stays in place" in to_text(tall, ())


def test_an_algorithm_that_knows_only_the_box_is_told(found):
    first = advice(found, leg_rows=False)[0]
    assert "0 of its 64 corners" in first.what
    assert "0.21 times" in first.do
    small = survey(compact(), frozen(0.2 * compact().box))
    assert not advice(small, leg_rows=False)
    assert "the whole rectangle is reachable" in to_html(small, ())


def test_an_axis_that_nothing_ends_is_told(found):
    free = replace(found.ranges[5], high_end=Ending(Limit.NOTHING))
    strange = replace(found, ranges=(*found.ranges[:5], free))
    assert "nothing ends yaw" in advice(strange)[0].what


def test_classical_and_saved_presets_come_from_the_configuration(tmp_path):
    saved = tmp_path / "state" / "presets"
    saved.mkdir(parents=True)
    (saved / "wild.toml").write_text('about = ""\n[values]\nbox_yaw_deg = 40.0\n')
    (saved / "soft.toml").write_text('about = ""\n[values]\nscale = 0.1\n')
    (saved / "odd.toml").write_text("about = 1")
    path = tmp_path / "c.toml"
    path.write_text(
        f'[server]\nstate_dir = "{tmp_path}/state"\n[cueing]\nalgorithm = "classical"\n'
        "[cueing.tuning]\nbox_heave_m = 0.05\n"
    )
    ended = run(str(path))
    assert ended.exit_code == 0
    text = " ".join(ended.stdout.split())
    assert "warning: preset wild goes beyond" in text
    assert "the algorithm keeps to the box alone" in text
    assert "preset odd cannot be used" in text
    assert "preset soft" not in text
    assert "machine's box" in text


def test_the_configured_head_is_taken(tmp_path):
    path = tmp_path / "c.toml"
    path.write_text("[platform]\nhead_m = [0.0, 0.0, 1.0]\n")
    assert "the same about a head that stays in place" in run(str(path)).stdout


def test_a_machine_alone(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(PRESET.replace('name = "t2-compact"', 'name = "mine"'))
    ended = run("--platform", str(path))
    assert ended.exit_code == 0
    assert ended.stdout.startswith(f"{path}: valid, limits ")
    assert "legs 3 4 long" in ended.stdout


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ((), "Give CONFIG.toml, or --platform"),
        (("c.toml", "--platform", "t2-compact"), "two machines"),
        (("--platform", "nobody"), "Allowed: t2-compact"),
        (("--platform", "absent.toml"), "cannot be read"),
        (("absent.toml",), "cannot be read"),
        (("--platform", "t2-compact", "--html", "absent/w.html"), "in a folder that exists"),
        (("--platform", "t2-compact", "--svg", "."), "cannot be written"),
    ],
)
def test_mistakes_are_told_in_one_line(words, said, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    ended = run(*words)
    assert isinstance(ended.exception, ConfigError)
    assert said in str(ended.exception)
    assert "\n" not in str(ended.exception)


def test_a_machine_file_that_contradicts_itself(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(PRESET.replace("max = 1.1811", "max = 1.0000"))
    ended = run("--platform", str(path))
    assert isinstance(ended.exception, ConfigError)
    assert "neutral" in str(ended.exception)


def test_without_a_shelf_or_limits_nothing_is_claimed():
    machine = replace(compact(), joint_angle=None, conditioning=None)
    text = workspace_text(machine, default_for(machine))
    assert text.count("not checked") == 2
    assert "conditioning " not in text.split("ended by")[2]
    smaller = apply_changes(
        default_for(machine), {"algorithm": "thondel2014", "box_roll_deg": 5.0, "legs": False}
    )
    assert "keeps to the box alone" in " ".join(workspace_text(machine, smaller).split())


def test_printed_numbers_leave_names_alone():
    assert printed("t2-compact -1.5 deg of +-2 deg, passive-3deg") == (
        "t2-compact \N{MINUS SIGN}1.5\N{DEGREE SIGN} of \N{PLUS-MINUS SIGN}2\N{DEGREE SIGN}, "
        "passive-3deg"
    )


def test_a_shelf_without_boxes_warns_of_nothing(tmp_path):
    machine = compact()
    text = workspace_text(machine, default_for(machine), PresetShelf(tmp_path))
    assert text.count("warning: ") == 1


def test_a_planes_file_names_its_machine(found):
    assert "<title>Workspace of t2-compact</title>" in planes_file(found)


def test_check_of_a_machine_without_a_box_computes_and_prints_it(tmp_path):
    before, _, after = PRESET.partition("[table2]")
    path = tmp_path / "mine.toml"
    path.write_text(before + "[pace]" + after.partition("[pace]")[2], "utf-8")
    ended = run("--platform", str(path))
    assert ended.exit_code == 0
    said = " ".join(ended.stdout.split())
    assert "no [table2] in the file; computed: table2 = { surge = 0.1979, sway = 0.2201" in said
    assert "warning [table2]" not in said
    config = tmp_path / "c.toml"
    config.write_text(f'[platform]\npreset = "{path}"\n[server]\nstate_dir = "{tmp_path}/s"\n')
    assert "no [table2] in the file; computed" in " ".join(run(str(config)).stdout.split())


def test_check_of_a_box_out_of_proportion_warns(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(PRESET.replace("surge = 0.198", "surge = 0.99"), "utf-8")
    ended = run("--platform", str(path))
    assert ended.exit_code == 0
    assert "surge 0.99 m, reached 0.1979 (5 times)" in " ".join(ended.stdout.split())
