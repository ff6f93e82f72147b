"""Which servers of this user run: announced by `run` and `demo`, found by other commands."""

from __future__ import annotations

import contextlib
import json
import os
import pwd
import stat
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from motionserver.errors import MotionServerError
from motionserver.settings.config import Config, load_config, run_dir_of, state_dir_of
from motionserver.telemetry.last_word import read_last_word
from motionserver.telemetry.mapped import MappedFile
from motionserver.telemetry.recorder import SILENT_NS
from motionserver.telemetry.ticker import now_ns

UNIT_RUN_DIR: Final = Path("/run/motionserver")
"""Run directory of deploy/motionserver.service, which announces itself in a /tmp of its own."""
UNIT_STATE_DIR: Final = Path("/var/lib/motionserver")
_FOLDER: Final = "motionserver-servers"
_LARGEST: Final = 4096
HOW_TO_START: Final = (
    "Start one: `motionserver demo` (no hardware), or `motionserver run CONFIG.toml` "
    "(`motionserver init > CONFIG.toml` makes the file)"
)


class NotRunningError(MotionServerError):
    """No server answers, or it is not clear which one is meant."""


@dataclass(frozen=True, slots=True)
class Server:
    """One server and its folders.

    Attributes:
        run_dir: Where its processes meet.
        state_dir: Where it keeps what outlives it.
        title: What it is, in words.
    """

    run_dir: Path
    state_dir: Path
    title: str

    def __str__(self) -> str:
        return f"{self.run_dir} ({self.title})"


@contextlib.contextmanager
def announced(server: Server) -> Iterator[None]:
    """Let the other commands of this user find a server while it runs.

    Raises:
        OSError: There is no place to announce it.
    """
    folder = _announcement_folders()[0]
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    if not _is_ours(folder):
        raise PermissionError(13, "others may write there", str(folder))
    pid = os.getpid()
    content = {
        "pid": pid,
        "started": _start_time(pid),
        "run_dir": str(server.run_dir.absolute()),
        "state_dir": str(server.state_dir.absolute()),
        "title": server.title,
    }
    path = folder / f"{pid}.json"
    path.unlink(missing_ok=True)
    with os.fdopen(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "w") as stream:
        json.dump(content, stream)
    try:
        yield
    finally:
        path.unlink(missing_ok=True)


def server_of(config: Config, title: str) -> Server:
    """The server of a configuration, running or not."""
    return Server(run_dir_of(config), state_dir_of(config), title)


def running_servers() -> list[Server]:
    """All servers of this user that run, by what they announced and by the usual folders."""
    default = server_of(load_config(None), "default folder")
    unit = Server(UNIT_RUN_DIR, UNIT_STATE_DIR, "systemd unit")
    found = {server.run_dir: server for server in (unit, default) if silence(server) is None}
    # an announcement tells more than a folder's name
    return list((found | {server.run_dir: server for server in _announcements()}).values())


def find_server(command: str, config: Path | None, run_dir: Path | None = None) -> Server:
    """The server that a command is for.

    Args:
        command: Named in errors.
        config: Configuration of the server; None for the one that runs.
        run_dir: Run directory, if it is named at the prompt.

    Raises:
        NotRunningError: It does not run; or none is named and several or none run.
    """
    server = _named(config, run_dir)
    if server is not None:
        problem = None if server in _announcements() else silence(server)
        if problem is not None:
            raise NotRunningError(
                f"{command}: no server runs in {server.run_dir}; {problem}. {HOW_TO_START}"
            )
        return server
    found = running_servers()
    if len(found) > 1:
        raise NotRunningError(
            f"{command}: {len(found)} servers are running: {'; '.join(map(str, found))}. "
            "Name one: --run-dir FOLDER"
        )
    if not found:
        default = server_of(load_config(None), "default folder")
        looked = f"{default.run_dir}: {silence(default)}"
        if UNIT_RUN_DIR.exists():
            unit = Server(UNIT_RUN_DIR, UNIT_STATE_DIR, "systemd unit")
            looked += f"; {UNIT_RUN_DIR}: {silence(unit)}"
        raise NotRunningError(
            f"{command}: no server is running ({looked}). {HOW_TO_START}. For a server with "
            "another run directory name its configuration or --run-dir FOLDER"
        )
    return found[0]


def find_folders(command: str, config: Path | None, run_dir: Path | None = None) -> Server:
    """The server whose files a command reads, whether it still runs or not.

    Raises:
        NotRunningError: None is named, and several run.
    """
    server = _named(config, run_dir)
    if server is not None:
        return server
    if running_servers():
        return find_server(command, None)
    return server_of(load_config(None), "default folder")


def silence(server: Server) -> str | None:
    """Why nobody can be heard in a run directory, in words; None if a guard reports there."""
    path = server.run_dir / "guard.map"
    try:
        owner = server.run_dir.stat().st_uid
        if owner != os.getuid() and not os.access(server.run_dir, os.R_OK | os.X_OK):
            name = _user_name(owner)
            return f"it belongs to the user {name}: ask as that user (sudo -u {name} ...)"
        shown = MappedFile(path)
    except FileNotFoundError:
        return _left(server.run_dir)
    except OSError as error:
        return f"it cannot be read ({error.strerror})"
    except ValueError as error:
        return f"it cannot be read ({error})"
    try:
        message = shown.read()
    finally:
        shown.close()
    if message is None:
        return "its guard has not reported yet"
    guard = json.loads(message[1])
    return None if now_ns() - guard["t_ns"] <= SILENT_NS else _last_word(guard)


def _left(run_dir: Path) -> str:
    """What a folder tells in which no server has anything mapped."""
    if not run_dir.exists():
        return "the folder does not exist"
    word = read_last_word(run_dir)
    return "there is nothing of a running server in it" if word is None else _last_word(word)


def _last_word(guard: dict[str, Any]) -> str:
    age = 1e-9 * (now_ns() - guard["t_ns"])
    return f"its last word is {age:.0f} s old: {guard['state']}, {guard['reason']}"


def _named(config: Path | None, run_dir: Path | None) -> Server | None:
    """The server that the prompt or the environment names; None if neither does."""
    loaded = load_config(config)
    if run_dir is None and config is None and not loaded.server.run_dir:
        return None
    title = str(config) if config is not None else "named"
    named = server_of(loaded, title)
    if run_dir is not None:
        named = Server(run_dir, named.state_dir, title)
    # it knows its own state directory best
    same = (one for one in _announcements() if one.run_dir == named.run_dir.absolute())
    return next(same, named)


def _announcement_folders() -> list[Path]:
    """Where servers announce themselves, our own first.

    A login may come with XDG_RUNTIME_DIR or without; one that points elsewhere than a login's does
    is a world of its own.
    """
    user = os.getuid()
    given, login = os.environ.get("XDG_RUNTIME_DIR"), f"/run/user/{user}"
    without = f"/tmp/motionserver-{user}"
    bases = [given] if given and given != login else [given or without, login, without]
    return [Path(base) / _FOLDER for base in dict.fromkeys(bases)]


def _announcements() -> list[Server]:
    """Announced servers that still run; what a killed one left behind is removed."""
    found: list[Server] = []
    for folder in _announcement_folders():
        if not _is_ours(folder):
            continue
        for path in sorted(folder.glob("*.json")):
            try:
                with path.open("rb") as stream:
                    told = json.loads(stream.read(_LARGEST))
                server = Server(Path(told["run_dir"]), Path(told["state_dir"]), told["title"])
                is_there = _start_time(told["pid"]) == told["started"]
            except (OSError, ValueError, KeyError, TypeError):
                continue
            if is_there or silence(server) is None:
                found.append(server)
            else:
                path.unlink(missing_ok=True)
    return found


def _is_ours(folder: Path) -> bool:
    """Whether nobody else can have written there."""
    try:
        about = folder.stat()
    except OSError:
        return False
    return about.st_uid == os.getuid() and not stat.S_IMODE(about.st_mode) & 0o022


def _start_time(pid: int) -> int | None:
    """When a process began, in ticks since the boot; None if it does not exist."""
    try:
        # the name in parentheses may hold anything
        return int(Path(f"/proc/{pid:d}/stat").read_text("utf-8").rpartition(")")[2].split()[19])
    except (OSError, ValueError, IndexError):
        return None


def _user_name(user: int) -> str:
    try:
        return pwd.getpwuid(user).pw_name
    except KeyError:
        return str(user)
