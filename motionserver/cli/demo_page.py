"""The demo's page: its link is printed at once, and opened when it answers."""

from __future__ import annotations

import asyncio
import contextlib
import threading
import webbrowser
from collections.abc import Callable
from typing import Final

_POLL: Final = 0.2
"""Pause between two tries to reach the page [s]."""


async def open_when_ready(
    host: str, port: int, link: str, wanted: bool, say: Callable[[str], None]
) -> None:
    """Wait for the page to answer, say so, and open it in the browser if that is wanted."""
    while True:
        if await _answers(host, port):
            break
        await asyncio.sleep(_POLL)
    say("the page answers")
    if wanted:
        # a browser in the terminal, or one named by $BROWSER, may keep its caller until it ends
        threading.Thread(target=_open, args=(link, say), daemon=True).start()


async def _answers(host: str, port: int) -> bool:
    try:
        _, writer = await asyncio.open_connection(host, port)
    except OSError:
        return False
    writer.close()
    with contextlib.suppress(OSError):
        await writer.wait_closed()
    return True


def _open(link: str, say: Callable[[str], None]) -> None:
    if not webbrowser.open(link):
        say("no browser could be opened here; open the link above")
