"""What somebody meets in the first hour: links with tokens, commands that need no arguments."""

import json
import os
import re
import signal
import subprocess
import threading
import urllib.request
from pathlib import Path

import pytest
import tomli_w
from rig import cli as process
from rig import command, environment, free_port, until

LINK = re.compile(r"(http://127\.0\.0\.1:\d+)/#token=(\S+)")


class Started:
    """A command that runs, with what it prints."""

    def __init__(self, env, *arguments):
        self.lines = []
        self.process = subprocess.Popen(
            command(*arguments), env=env, text=True,
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
        )  # fmt: skip
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self):
        with self.process.stdout as lines:
            self.lines.extend(lines)

    @property
    def text(self):
        return "".join(self.lines)

    def expect(self, pattern, times=1):
        def seen():
            if self.process.poll() is not None:
                self._reader.join(5)
                assert len(re.findall(pattern, self.text)) >= times, self.text
            return len(re.findall(pattern, self.text)) >= times

        until(seen, f"{pattern!r} in\n{self.text}", 120.0)

    def end(self, number=signal.SIGINT):
        if self.process.poll() is None:
            self.process.send_signal(number)
        status = self.process.wait(120)
        self._reader.join(5)
        return status


@pytest.fixture
def env(tmp_path, monkeypatch):
    """A user who has started nothing else."""
    (tmp_path / "xdg").mkdir(mode=0o700)
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path / "xdg"))
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "home"))
    return environment()


@pytest.fixture
def started(env):
    running = []

    def start(*arguments, **more):
        running.append(Started(env | more, *arguments))
        return running[-1]

    yield start
    for one in running:
        if one.process.poll() is None:
            one.process.send_signal(signal.SIGTERM)
            try:
                one.process.wait(100)
            except subprocess.TimeoutExpired:
                one.process.kill()


def role_of(url, token):
    request = urllib.request.Request(url + "/api/status")
    request.add_header("Authorization", f"Bearer {token}")
    with urllib.request.urlopen(request, timeout=10) as answer:
        return answer.headers["x-motion-role"]


def child_of(pid, words):
    """The process that was started by another with these words."""
    for entry in Path("/proc").iterdir():
        try:
            parent = int((entry / "stat").read_text().rpartition(")")[2].split()[1])
            line = (entry / "cmdline").read_bytes().replace(b"\0", b" ").decode()
        except (OSError, ValueError, IndexError):
            continue
        if parent == pid and words in line:
            return int(entry.name)
    raise AssertionError(f"{pid} has no child {words!r}")


def test_the_demo_gives_a_link_answers_commands_and_survives_a_fault(tmp_path, started):
    opened = tmp_path / "opened"
    browser = tmp_path / "browser"
    browser.write_text(f'#!/bin/sh\necho "$1" > {opened}\n', "ascii")
    browser.chmod(0o755)
    demo = started("demo", "--open", BROWSER=str(browser))
    demo.expect(LINK.pattern)
    demo.expect("loading guard")
    url, token = LINK.search(demo.text).groups()
    # not after a wait that may end before the page has made its tokens
    assert demo.text.index("#token=") < demo.text.index(" s  ")
    demo.expect("the page answers")
    assert role_of(url, token) == "operator"
    until(opened.exists, "the browser to be opened")
    until(lambda: opened.read_text() == f"{url}/#token={token}\n", "the link in the browser")

    demo.expect(r"  RUN: ")
    shown = process("status")
    assert shown.returncode == 0, shown.stderr
    assert "(demo)" in shown.stdout
    assert set(json.loads(process("status", "--json").stdout)) >= {"guard", "planner"}
    recorded = process("record", "--seconds", "0.5", "--out", str(tmp_path / "drive.csv"))
    assert recorded.returncode == 0, recorded.stderr

    # a base that stands still for a moment: the server faults
    base = child_of(demo.process.pid, "emulate")
    os.kill(base, signal.SIGSTOP)
    try:
        demo.expect(r"  FAULT: no feedback")
    finally:
        os.kill(base, signal.SIGCONT)
    demo.expect("driving again after the fault")
    assert "resets by itself" in demo.text
    assert process("blackbox", "list").stdout.count("FAULT") >= 1

    parked = process("park")
    assert parked.returncode == 0, parked.stdout + parked.stderr
    demo.expect("to drive on: Engage on the page, or `motionserver engage`")
    engaged = process("engage")
    assert engaged.returncode == 0, engaged.stdout + engaged.stderr
    demo.expect(r"  RUN: ", times=3)
    assert demo.end() == 0, demo.text
    assert "faults on the way, each reset by the demo: FAULT: no feedback" in demo.text
    assert "Traceback" not in demo.text
    gone = process("status")
    assert gone.returncode == 2
    assert "no server is running" in gone.stderr


def test_a_demo_whose_base_dies_ends_with_the_reason_and_status_1(started):
    demo = started("demo", "--no-page")
    demo.expect(r"  RUN: ")
    os.kill(child_of(demo.process.pid, "emulate"), signal.SIGKILL)
    assert demo.process.wait(120) == 1
    demo.end()
    assert "the emulator has ended by itself, status -9" in demo.text
    assert "Traceback" not in demo.text


def test_run_prints_a_link_at_its_first_start_only(tmp_path, started):
    path = tmp_path / "my.toml"
    sections = {
        "platform": {"port": 9, "local_port": 0},
        "sources": [{"listen": f"127.0.0.1:{free_port()}"}],
        "web": {"port": 0},
        "server": {"run_dir": str(tmp_path / "run"), "state_dir": str(tmp_path / "state")},
    }
    path.write_text(tomli_w.dumps(sections), "utf-8")
    first = started("run", str(path))
    first.expect(LINK.pattern)
    url, token = LINK.search(first.text).groups()
    until(lambda: answers(url), "the page to answer")
    assert role_of(url, token) == "operator"
    assert process("status").stdout.splitlines()[-1].endswith(f"({path})")
    first.end(signal.SIGTERM)
    second = started("run", str(path))
    second.expect(rf"page http://127\.0\.0\.1:\d+, tokens in {tmp_path}/state/tokens\.json")
    second.end(signal.SIGTERM)
    assert "#token" not in second.text


def answers(url):
    try:
        with urllib.request.urlopen(url + "/healthz", timeout=1):
            return True
    except OSError:
        return False


@pytest.mark.parametrize("wrong", [("--open", "--no-page")])
def test_a_page_that_is_not_there_cannot_be_opened(wrong):
    ended = process("demo", *wrong)
    assert (ended.returncode, ended.stdout) == (2, "")
    assert ended.stderr.startswith("motionserver: --open: there is no page with --no-page")
