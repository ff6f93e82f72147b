"""Requests between processes: small JSON datagrams over unix sockets, answered once."""

from __future__ import annotations

import contextlib
import itertools
import json
import os
import socket
from pathlib import Path
from typing import Any, Final

MAX_BYTES: Final = 4096
DRAIN: Final = 8
"""Requests served per tick; more wait, or are dropped by a full queue."""

_numbers = itertools.count()


class RequestError(OSError):
    """A request was not answered: nobody listens, or not in time."""


class RequestServer:
    """The receiving end; polled from a tick, never waits.

    Attributes:
        malformed: Requests that were none.
        refusal: Why nobody can be heard, in words; empty if one can. A guard goes on without.
    """

    def __init__(self, path: Path) -> None:
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        self.malformed, self.refusal = 0, ""
        try:
            path.unlink(missing_ok=True)
            self._socket.bind(str(path))
            path.chmod(0o600)
        except OSError as error:
            self.refusal = f"{path}: {error.strerror}: nobody can ask for anything"

    def poll(self) -> list[tuple[dict[str, Any], str]]:
        """Requests that wait, at most `DRAIN`, each with the address for its answer."""
        out: list[tuple[dict[str, Any], str]] = []
        for _ in range(DRAIN):
            try:
                data, address = self._socket.recvfrom(MAX_BYTES + 1)
            except BlockingIOError:
                break
            try:
                if len(data) > MAX_BYTES:
                    raise ValueError("too long")
                message = json.loads(data)
                if not isinstance(message, dict) or not isinstance(message.get("op"), str):
                    raise TypeError("no op")
            except (ValueError, TypeError, RecursionError):
                self.malformed += 1
                continue
            out.append((message, address or ""))
        return out

    def answer(self, address: str, message: dict[str, Any]) -> None:
        """Send an answer; a peer that has gone or does not read loses it."""
        if address:
            with contextlib.suppress(OSError):
                self._socket.sendto(json.dumps(message).encode(), address)

    def close(self) -> None:
        """Stop listening."""
        self._socket.close()


def ask(path: Path, request: dict[str, Any], timeout: float = 1.0) -> dict[str, Any]:
    """Send a request and wait for its answer.

    Args:
        path: The server's socket.
        request: JSON-able, with a word under "op"; at most `MAX_BYTES` as JSON.
        timeout: How long to wait [s].

    Returns:
        The answer.

    Raises:
        RequestError: Nobody answers there.
    """
    own = path.parent / f"ask-{os.getpid()}-{next(_numbers)}.sock"
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as link:
        try:
            own.unlink(missing_ok=True)
            link.bind(str(own))
            link.settimeout(timeout)
            link.sendto(json.dumps(request).encode(), str(path))
            answer = json.loads(link.recv(65536))
        except (FileNotFoundError, ConnectionRefusedError) as error:
            raise RequestError(
                f"nobody listens at {path}; is the server running with this configuration?"
            ) from error
        except (OSError, ValueError) as error:
            why = (error.strerror if isinstance(error, OSError) else str(error)) or "timed out"
            raise RequestError(
                f"no answer from {path.name} in {timeout:g} s ({why}); is the server running with "
                "this configuration?"
            ) from error
        finally:
            own.unlink(missing_ok=True)
    if not isinstance(answer, dict):
        raise RequestError(f"{path.name} answered something else than an object")
    return answer
