"""The command line against a running server, and against everything that is wrong."""

import json
import os
import re
import signal
import socket
import stat
from pathlib import Path

import pytest
import tomli_w
from in_process import Cli, typed
from motion_clients.moog_device import MoogDevice
from motion_clients.moog_wire import Mcw
from motion_clients.motion_log import read_motion_log
from rig import Rig, assert_soft, free_port, until
from rig import cli as process

STATES = "OFFLINE|PARKED|RAISING|READY|RUN|HOLD|PARKING|FAULT|SAFE"


def one_line(text: str) -> bool:
    return text.startswith("motionserver: ") and text.count("\n") == 1


@pytest.fixture
def cli(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Cli:
    """The command line in this process: a busy machine starts Python slowly."""
    return typed(capsys, monkeypatch)


def write(path: Path, **sections: object) -> str:
    path.write_text(tomli_w.dumps(sections), "utf-8")
    return str(path)


def test_commands_of_an_operator(tmp_path: Path, cli: Cli) -> None:
    with Rig(tmp_path) as rig:
        config = str(rig.config)
        rig.wait_state("PARKED")
        early = cli("engage", config)
        assert early.returncode == 1
        assert "engage: refused, state PARKED: no fresh source: " in early.stdout
        reset = cli("reset", config)
        assert (reset.returncode, "nothing to reset" in reset.stdout) == (1, True)
        rig.drive()
        rig.wait_for(lambda: rig.shown()["source"]["fresh"], "a fresh source")
        # a base that stood still for a moment is offline for a moment
        rig.wait_for(lambda: cli("engage", config).returncode == 0, "engaging to be granted")
        rig.wait_state("RUN")
        shown = cli("status", config)
        assert shown.returncode == 0
        assert re.search(rf"^state +({STATES})", shown.stdout)
        parts = json.loads(cli("status", config, "--json").stdout)
        assert set(parts) == {"guard", "planner", "processes", "blackbox"}

        # the device's own trouble is a fault that stays until somebody resets it
        rig.base.do(lambda emulator: MoogDevice.press_estop(emulator.device))
        rig.wait_state("SAFE")
        assert cli("engage", config).returncode == 1
        rig.base.do(lambda emulator: MoogDevice.release_estop(emulator.device))
        # granted as soon as nothing is played, tried for two seconds: the base may need longer

        def reset_took() -> bool:
            cli("reset", config)
            return rig.state == "PARKED"

        rig.wait_for(reset_took, "a reset to succeed")
        rig.engage()
        rig.wait_state("RUN")
        assert cli("park", config).returncode == 0
        rig.wait_state("PARKING", "PARKED")

        # a second server in the same place, and one with the same platform port
        second = process("run", config)
        assert second.returncode == 2
        assert one_line(second.stderr)
        assert "another server runs in" in second.stderr
        elsewhere = tmp_path / "elsewhere.toml"
        told = rig.config.read_text("utf-8").replace(str(rig.run_dir), str(tmp_path / "other"))
        elsewhere.write_text(told.replace(str(rig.cue_port), str(free_port())), "utf-8")
        third = process("run", str(elsewhere))
        assert third.returncode == 2
        assert one_line(third.stderr)
        assert f"drives 127.0.0.1:{rig.base.port}" in third.stderr
        assert rig.end() == 0
        assert rig.leftovers() == []
        left = {path.name for path in rig.run_dir.iterdir()}
        assert left == {".motionserver-run", "guard.lock", "service.lock"}
        assert stat.S_IMODE(rig.run_dir.stat().st_mode) == 0o700
        gone = cli("status", config)
        assert gone.returncode == 2
        assert one_line(gone.stderr)
        assert "no server runs in" in gone.stderr
        verdict = rig.verdict()
    assert_soft(verdict)


def test_a_dry_run_sends_the_mode_word_only(tmp_path: Path) -> None:
    with Rig(tmp_path, arguments=("--dry-run",)) as rig:
        rig.run()
        rig.wait_plans(30)
        assert rig.shown()["dry_run"] is True
        assert rig.end() == 0
        verdict = rig.verdict()
    words = {int.from_bytes(data[:4], "big") for _, data in read_motion_log(tmp_path / "base.log")}
    assert words == {Mcw.LENGTH_MODE}
    assert verdict["states_visited"] == ["POWER_UP", "IDLE"]
    assert verdict["positions"] == 0


def base(folder: Path, **platform: object) -> dict[str, object]:
    return {
        "server": {"run_dir": str(folder / "run")},
        "platform": {"port": 9, "local_port": 0, **platform},
        "sources": [{"listen": "127.0.0.1:0"}],
        "web": {"port": 0},
    }


def test_a_running_server_that_is_wrong_from_the_start_says_so_in_one_line(
    tmp_path: Path, cli: Cli
) -> None:
    with (
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken,
        socket.socket(socket.AF_INET, socket.SOCK_STREAM) as page,
    ):
        taken.bind(("127.0.0.1", 0))
        page.bind(("127.0.0.1", 0))
        page.listen()
        port, page_port = taken.getsockname()[1], page.getsockname()[1]
        good = base(tmp_path)
        cases = {
            "cannot be read": str(tmp_path / "missing.toml"),
            "not TOML": str(tmp_path / "broken.toml"),
            "unknown key 'prot'": write(tmp_path / "a.toml", platform={"prot": 5}),
            f"127.0.0.1:{port} cannot be bound": write(
                tmp_path / "b.toml", **base(tmp_path, local_port=port)
            ),
            f"[[sources]] native 127.0.0.1:{port}": write(
                tmp_path / "c.toml", **{**good, "sources": [{"listen": f"127.0.0.1:{port}"}]}
            ),
            f"[web] port: 127.0.0.1:{page_port}": write(
                tmp_path / "d.toml", **{**good, "web": {"port": page_port}}
            ),
            "Not a directory": write(
                tmp_path / "e.toml", **{**good, "server": {"run_dir": "/etc/hostname/x"}}
            ),
            "holds mine.txt": write(
                tmp_path / "h.toml", **{**good, "server": {"run_dir": str(tmp_path / "mine")}}
            ),
            "too long a path": write(
                tmp_path / "f.toml", **{**good, "server": {"run_dir": str(tmp_path / ("x" * 90))}}
            ),
        }
        (tmp_path / "broken.toml").write_text("[platform\n", "utf-8")
        (tmp_path / "mine").mkdir()
        (tmp_path / "mine" / "mine.txt").write_text("mine", "utf-8")
        for words, path in cases.items():
            ended = cli("run", path)
            assert (ended.returncode, ended.stdout) == (2, ""), words
            assert one_line(ended.stderr), ended.stderr
            assert words in ended.stderr


def test_two_sources_on_one_port_are_refused(tmp_path: Path, cli: Cli) -> None:
    listen = f"127.0.0.1:{free_port()}"
    path = write(
        tmp_path / "twice.toml",
        **{**base(tmp_path), "sources": [{"listen": listen}, {"kind": "beamng", "listen": listen}]},
    )
    ended = cli("run", path)
    assert ended.returncode == 2
    assert f"[[sources]] beamng {listen}" in ended.stderr


@pytest.mark.parametrize("words", [("engage",), ("park",), ("reset",), ("status",), ("record",)])
def test_nobody_to_talk_to(tmp_path: Path, cli: Cli, words: tuple[str, ...]) -> None:
    for folder in (tmp_path / "never", tmp_path):
        path = write(tmp_path / "c.toml", server={"run_dir": str(folder)})
        ended = cli(*words, path)
        assert ended.returncode == 2
        assert one_line(ended.stderr), ended.stderr
        assert "running" in ended.stderr or "no server runs" in ended.stderr


def test_check_says_what_a_configuration_means(tmp_path: Path, cli: Cli) -> None:
    path = write(tmp_path / "c.toml", **base(tmp_path, mode="dof"))
    ended = cli("check", path)
    assert ended.returncode == 0
    for words in (": valid", "t2-compact", "limits ", "mpc", "takes a pose"):
        assert words in ended.stdout
    wrong = cli("check", write(tmp_path / "w.toml", cueing={"algorithm": "magic"}))
    assert wrong.returncode == 2
    assert one_line(wrong.stderr)
    assert "Allowed: mpc, classical" in wrong.stderr


def test_a_server_left_for_dead_is_not_taken_for_a_living_one(tmp_path: Path, cli: Cli) -> None:
    with Rig(tmp_path) as rig:
        rig.wait_state("PARKED")
        for pid in (rig.server.pid, *rig.leftovers()):
            os.kill(pid, signal.SIGKILL)
        rig.server.wait()

        def said() -> bool:
            ended = cli("status", str(rig.config))
            return ended.returncode == 2 and "its last word is" in ended.stderr

        until(said, "status to say that nobody runs")
