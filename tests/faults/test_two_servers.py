"""A second server on a running one's platform refuses to start; a page without descriptors."""

import contextlib
import json
import resource
import socket
import tomllib
import urllib.request
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import pytest
import tomli_w
from far_ends import FarRig
from rig import assert_soft, cli, free_port

SPARE_DESCRIPTORS = 6
CROWD = 60


def second(rig: FarRig, name: str, changes: Mapping[str, Mapping[str, Any]]) -> str:
    """Start another server with a changed configuration; why it does not."""
    data = tomllib.loads(rig.config.read_text("utf-8"))
    for section, values in changes.items():
        data[section] = values if section == "sources" else {**data[section], **values}
    path = rig.folder / f"{name}.toml"
    path.write_text(tomli_w.dumps(data), "utf-8")
    done = cli("run", str(path), timeout=30.0)
    assert done.returncode == 2, (done.returncode, done.stderr)
    assert "Traceback" not in done.stderr
    return done.stderr


def second_servers(rig: FarRig) -> None:
    """Whatever it shares with the first one: folder, platform, input."""
    port = json.loads((rig.run_dir / "config.json").read_text("utf-8"))["sources"][0]["port"]
    elsewhere = {"server": {"run_dir": str(rig.folder / "other")}, "web": {"enabled": False}}
    inputs = {"sources": [{"kind": "native", "listen": f"127.0.0.1:{free_port()}"}]}
    assert "another server runs in" in second(rig, "same", {})
    told = second(rig, "same_platform", {**elsewhere, **inputs})
    assert f"127.0.0.1:{rig.base.port}" in told, told
    platform = {"platform": {"port": free_port()}}
    told = second(rig, "same_input", {**elsewhere, **platform})
    assert f"127.0.0.1:{port} cannot be bound" in told, told


def answers(rig: FarRig) -> bool:
    url = f"http://127.0.0.1:{rig.page_port}/"
    with contextlib.suppress(OSError), urllib.request.urlopen(url, timeout=10.0) as answer:
        return bool(answer.status == 200)
    return False


def starve_page(rig: FarRig) -> None:
    """A page that may open hardly anything more is crowded; it recovers, and nothing else knows."""
    web = rig.pid("web")
    assert web is not None
    rig.wait_for(lambda: answers(rig), "the page")
    usual = resource.prlimit(web, resource.RLIMIT_NOFILE)
    used = len(list(Path(f"/proc/{web}/fd").iterdir()))
    resource.prlimit(web, resource.RLIMIT_NOFILE, (used + SPARE_DESCRIPTORS, usual[1]))
    with contextlib.ExitStack() as crowd:
        for _ in range(CROWD):
            link = crowd.enter_context(socket.socket())
            link.setblocking(False)
            link.connect_ex(("127.0.0.1", rig.page_port))
        full = used + SPARE_DESCRIPTORS
        rig.wait_for(
            lambda: len(list(Path(f"/proc/{web}/fd").iterdir())) == full, "no descriptor left"
        )
        rig.wait_plans(30)
        assert not answers(rig)
    rig.wait_for(lambda: answers(rig), "the page to recover")
    resource.prlimit(web, resource.RLIMIT_NOFILE, usual)
    assert rig.pid("web") == web


def drive(folder: Path, harm: Callable[[FarRig], None]) -> None:
    with FarRig(folder, web=True) as rig:
        rig.run()
        way = rig.way()
        harm(rig)
        rig.wait_plans(20)
        rig.wait_state("RUN")
        assert rig.way() == way
        assert set(rig.shown("service")["restarts"].values()) == {0}
        assert rig.end() == 0
        verdict = rig.verdict()
    assert_soft(verdict)


@pytest.mark.campaign
def test_second_servers_leave_the_first_alone(tmp_path: Path) -> None:
    drive(tmp_path, second_servers)


@pytest.mark.campaign
def test_a_page_without_descriptors_recovers(tmp_path: Path) -> None:
    drive(tmp_path, starve_page)
    print(f"log: {(tmp_path / 'server.log').stat().st_size} bytes")
