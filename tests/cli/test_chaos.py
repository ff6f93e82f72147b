"""The command `chaos`: what it says, what it refuses, how it ends."""

import contextlib
import json
import os
import pty
import signal
import socket
import subprocess
from dataclasses import asdict
from pathlib import Path

import pytest
from in_process import Cli, typed
from motion_clients.delay_line import WayCounts
from motion_clients.fault_proxy import seed_of
from motion_clients.flawed_link import FlawedLink, LinkFlaws
from rig import PATIENCE, command, environment, free_port, until

from motionserver.cli.chaos_options import ChaosOptions
from motionserver.cli.chaos_run import second_text, summary_text

ENDS = ("--listen", "127.0.0.1:0", "--to", "127.0.0.1:9")


@pytest.fixture
def chaos(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Cli:
    """The command in this process."""
    return typed(capsys, monkeypatch, "chaos")


@pytest.mark.parametrize(
    ("flag", "value", "words"),
    [
        *(
            (f"--{name}", value, ("%", "0 to 100"))
            for name in ("loss", "duplicate", "reorder", "corrupt", "truncate")
            for value in ("-1", "100.1", "nan")
        ),
        *(
            (f"--{name}", value, ("ms", "0 to 10000"))
            for name in ("delay-ms", "jitter-ms", "reorder-ms")
            for value in ("-1", "10001", "nan", "inf")
        ),
        *(
            ("--silent", value, (repr(value), "FROM:UNTIL", "5:7"))
            for value in ("5", "7:5", "5:5", "-1:5", "a:b", ":", "nan:1", "1:nan", "")
        ),
        ("--seconds", "0", ("0", "positive")),
        ("--seconds", "nan", ("nan", "positive")),
        ("--listen", "localhost", ("'localhost'", "HOST:PORT")),
        ("--listen", "127.0.0.1:70000", ("70000", "HOST:PORT")),
        ("--listen", "192.0.2.1:5000", ("192.0.2.1:5000", "assign", "Choose another")),
        ("--to", "127.0.0.1:0", ("port 0", "1 to 65535")),
        ("--to", "no-such-host.invalid:9", ("no-such-host.invalid:9", "known")),
        ("--json", "/no/such/folder/out.json", ("out.json", "No such file", "Choose another")),
    ],
)
def test_mistakes_name_flag_value_and_what_to_do(chaos, flag, value, words):
    ended = chaos(*ENDS, "--seconds", "0.01", flag, value)
    assert ended.returncode == 2
    assert ended.stderr.startswith(f"motionserver: {flag}: ")
    assert ended.stderr.count("\n") == 1
    for word in words:
        assert word in ended.stderr
    assert ended.stdout == ""


def test_a_taken_port_and_the_proxy_itself_are_refused(chaos):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", 0))
        port = f"127.0.0.1:{taken.getsockname()[1]}"
        ended = chaos("--listen", port, "--to", "127.0.0.1:9")
    assert ended.returncode == 2
    assert (
        ended.stderr == f"motionserver: --listen: {port}: Address already in use. Choose another.\n"
    )
    ended = chaos("--listen", port, "--to", port)
    assert ended.returncode == 2
    assert f"--to: {port}: the target is the proxy itself" in ended.stderr


def test_per_cent_and_milliseconds_become_shares_and_seconds():
    options = ChaosOptions(
        listen="127.0.0.1:1",
        to="127.0.0.1:2",
        delay_ms=20.0,
        jitter_ms=5.0,
        loss=5.0,
        duplicate=1.0,
        reorder=2.0,
        reorder_ms=40.0,
        corrupt=3.0,
        truncate=100.0,
        silent=("5:7.5", "20:"),
    )
    assert options.flaws() == LinkFlaws(
        loss=0.05,
        duplicate=0.01,
        reorder=0.02,
        corrupt=0.03,
        truncate=1.0,
        delay=0.02,
        jitter=0.005,
        reorder_delay=0.04,
        silences=((5.0, 7.5), (20.0, float("inf"))),
    )
    assert options.ends() == (("127.0.0.1", 1), ("127.0.0.1", 2))
    assert options.flaws_shown()["loss_percent"] == 5.0
    assert options.flaws_shown()["delay_ms"] == 20.0
    assert options.flaws_shown()["silent"] == [[5.0, 7.5], [20.0, None]]
    assert options.in_words() == (
        "loss 5 %, duplicate 1 %, reorder 2 %, corrupt 3 %, truncate 100 %, "
        "delay 20 ms, jitter 5 ms, silent 5:7.5 s, silent 20: s"
    )
    assert ChaosOptions(listen="", to="").in_words() == "no flaws"


def test_it_ends_by_itself_and_leaves_the_counters(chaos, tmp_path):
    out = tmp_path / "out.json"
    ended = chaos(
        *ENDS, "--seconds", "0.05", "--loss", "5", "--silent", "1:", "--json", str(out), "--no-back"
    )
    assert (ended.returncode, ended.stderr) == (0, "")
    first, *ways, last = ended.stdout.splitlines()
    assert [line.split()[0] for line in ways] == ["there", "back"]  # no seconds: no terminal
    assert first.endswith(" -> 127.0.0.1:9: loss 5 %, silent 1: s; seed 0; replies pass unharmed")
    assert last == "0 senders in 0.1 s"
    written = json.loads(out.read_text("utf-8"), parse_constant=pytest.fail)
    assert set(written) == {
        "listen",
        "to",
        "seed",
        "flaws",
        "replies_flawed",
        "seconds",
        "sessions",
        "peers",
        "refused",
        "unreachable",
        "there",
        "back",
    }
    assert written["replies_flawed"] is False
    assert written["there"] == written["back"] == {**asdict(WayCounts()), "waiting": 0}


def test_every_flag_arrives_under_its_name(chaos, tmp_path):
    out = tmp_path / "out.json"
    shares = {"loss": 1.5, "duplicate": 2, "reorder": 3, "corrupt": 4, "truncate": 5}
    times = {"delay_ms": 6, "jitter_ms": 7, "reorder_ms": 8}
    flags = [
        word
        for name, value in (shares | times).items()
        for word in (f"--{name.replace('_', '-')}", str(value))
    ]
    flags += ["--silent", "9:10", "--silent", "11:", "--seed", "12"]
    ended = chaos(*ENDS, *flags, "--seconds", "0.01", "--json", str(out))
    assert ended.returncode == 0
    written = json.loads(out.read_text("utf-8"))
    assert written["flaws"] == {
        **{f"{name}_percent": value for name, value in shares.items()},
        **times,
        "silent": [[9.0, 10.0], [11.0, None]],
    }
    assert written["seed"] == 12
    assert written["replies_flawed"] is True
    assert "loss 1.5 %, duplicate 2 %" in ended.stdout


def test_a_second_is_told_by_its_difference():
    before = {"there": {**asdict(WayCounts()), "waiting": 0}}
    before["back"] = dict(before["there"])
    now = {way: dict(counts) for way, counts in before.items()}
    now["there"] |= {"sent": 95, "lost": 3, "dropped": 1, "unsent": 1, "changed": 7}
    now["back"] |= {"sent": 60}
    assert second_text(12.0, before, now) == (
        "    12 s  there    95 through    5 lost    7 changed"
        "   back    60 through    0 lost    0 changed"
    )
    assert "there     0 through    0 lost    0 changed" in second_text(13.0, now, now)


def test_the_summary_tells_what_is_unusual_only_if_it_happened():
    counts = {**asdict(WayCounts()), "waiting": 0}
    counted = {
        "to": "127.0.0.1:9",
        "seconds": 3.0,
        "sessions": 1,
        "refused": 0,
        "unreachable": 0,
        "there": counts,
        "back": counts,
    }
    assert len(summary_text(counted).splitlines()) == 3
    trouble = {"waiting": 4, "dropped": 5, "unsent": 6}
    told = summary_text(
        {**counted, "refused": 7, "unreachable": 8, "there": {**counts, **trouble}}
    ).splitlines()
    assert len(told) == 8
    for words in (
        "there  4 still on their way",
        "there  5 dropped",
        "there  6 refused by the network",
        "nobody listened at 127.0.0.1:9, told 8 times",
        "7 packets of further senders refused: at most 16",
        "1 sender in 3.0 s",
    ):
        assert any(line.startswith(words) for line in told), words


@pytest.mark.parametrize(
    ("number", "replies"), [(signal.SIGINT, "--back"), (signal.SIGTERM, "--no-back")]
)
def test_a_signal_ends_it_with_status_0(tmp_path: Path, number: int, replies: str) -> None:
    """In a terminal: with a line for every second, of the packets of that second."""
    port, out = free_port(), tmp_path / "out.json"
    ours, theirs = pty.openpty()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as target:
        target.bind(("127.0.0.1", 0))
        target.settimeout(PATIENCE)
        to = f"127.0.0.1:{target.getsockname()[1]}"
        arguments = ("--listen", f"127.0.0.1:{port}", "--to", to, "--json", str(out))
        arguments += ("--corrupt", "100", "--seed", "3", replies)
        with (
            subprocess.Popen(
                command("chaos", *arguments), env=environment(), stdout=theirs, stderr=theirs
            ) as process,
            contextlib.ExitStack() as stack,
        ):
            stack.callback(process.kill)  # a failure below must not wait for it
            os.close(theirs)
            said = b""
            while b"->" not in said:
                said += os.read(ours, 4096)
            with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
                sender.settimeout(PATIENCE)
                sender.sendto(b"ping", ("127.0.0.1", port))
                arrived, upstream = target.recvfrom(100)
                link = FlawedLink(LinkFlaws(corrupt=1.0), seed=seed_of(3, 0, "there"))
                assert [arrived] == [copy.datagram for copy in link.carry(0.0, b"ping")]
                target.sendto(b"pong", upstream)
                assert (sender.recv(100) == b"pong") == (replies == "--no-back")
            # the second in which it went, and a later one in which nothing did
            while (
                b"there     0 through"
                not in said.partition(b" s  there     1 through    0 lost")[2]
            ):
                said += os.read(ours, 4096)
            process.send_signal(number)
            until(lambda: process.poll() is not None, "the end")
            while b"1 sender in" not in said:
                said += os.read(ours, 4096)
    os.close(ours)
    assert process.returncode == 0
    assert b"there  1 packets came, 1 went on" in said
    assert b"Traceback" not in said
    written = json.loads(out.read_text("utf-8"))
    assert (written["there"]["sent"], written["back"]["sent"]) == (1, 1)
    assert written["there"]["changed"] == 1
    assert written["back"]["changed"] == (replies == "--back")
