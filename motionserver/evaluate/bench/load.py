"""HTTP load: keep-alive requests as fast as they are answered, and readers of the stream.

Run as ``python -m motionserver.evaluate.bench.load PORT SECONDS CONNECTIONS STREAMS``. It is a
process of ordinary priority that competes for the same cores as the server does.
"""

from __future__ import annotations

import asyncio
import contextlib
import sys
from collections import Counter

from motionserver.evaluate.bench.processes import say


async def press(port: int, seconds: float, connections: int, streams: int) -> dict[str, float]:
    """Ask until the time is over.

    Args:
        port: Of the page, on loopback.
        seconds: How long [s].
        connections: Keep-alive connections, each with one request under way.
        streams: Readers of the event stream.

    Returns:
        Requests and events per second that were answered, and refusals counted.
    """
    loop = asyncio.get_running_loop()
    counts: Counter[str] = Counter()
    end = loop.time() + seconds
    tasks = [asyncio.create_task(_ask(port, end, counts)) for _ in range(connections)]
    tasks += [asyncio.create_task(_listen(port, counts)) for _ in range(streams)]
    began = loop.time()
    await asyncio.sleep(seconds)
    took = loop.time() - began
    for task in tasks:
        task.cancel()
    await asyncio.gather(*tasks, return_exceptions=True)
    return {
        "requests_per_s": counts["answers"] / took,
        "events_per_s": counts["events"] / took,
        "refused": counts["refused"],
        "broken": counts["broken"],
    }


class _Asker(asyncio.Protocol):
    """One keep-alive connection that asks again as soon as it is answered."""

    def __init__(self, port: int, counts: Counter[str], closed: asyncio.Event) -> None:
        self._asked, self._counts, self._closed = _request("/api/status", port), counts, closed
        self._answer = bytearray()
        self._wanted = 0
        self._transport: asyncio.WriteTransport | None = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Ask."""
        assert isinstance(transport, asyncio.WriteTransport)
        self._transport = transport
        transport.write(self._asked)

    def data_received(self, data: bytes) -> None:
        """Count a whole answer, and ask again."""
        answer = self._answer
        answer += data
        if not self._wanted:
            head = answer.find(b"\r\n\r\n")
            if head < 0:
                return
            length = bytes(answer[:head]).lower().partition(b"content-length:")[2]
            self._wanted = head + 4 + int(length.partition(b"\r\n")[0] or 0)
        if len(answer) >= self._wanted and self._transport is not None:
            self._counts["answers" if b" 200 " in answer[:20] else "refused"] += 1
            self._wanted = 0
            answer.clear()
            self._transport.write(self._asked)

    def connection_lost(self, exc: Exception | None) -> None:
        """Let another one be made."""
        self._closed.set()


async def _ask(port: int, end: float, counts: Counter[str]) -> None:
    loop = asyncio.get_running_loop()
    while loop.time() < end:
        closed = asyncio.Event()
        try:
            transport, _ = await loop.create_connection(
                lambda closed=closed: _Asker(port, counts, closed),  # type: ignore[misc]
                "127.0.0.1",
                port,
            )
        except OSError:
            counts["broken"] += 1
            await asyncio.sleep(0.05)
            continue
        with contextlib.closing(transport):
            await closed.wait()


async def _listen(port: int, counts: Counter[str]) -> None:
    while True:
        with contextlib.suppress(OSError):
            reader, writer = await asyncio.open_connection("127.0.0.1", port)
            with contextlib.closing(writer):
                writer.write(_request("/api/stream", port))
                while chunk := await reader.read(65536):
                    counts["events"] += chunk.count(b"data: ")
        counts["broken"] += 1
        await asyncio.sleep(0.05)


def _request(path: str, port: int) -> bytes:
    return f"GET {path} HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\n\r\n".encode()


def main(arguments: list[str]) -> int:
    """Press, and tell."""
    port, seconds = int(arguments[0]), float(arguments[1])
    connections, streams = int(arguments[2]), int(arguments[3])
    say(asyncio.run(press(port, seconds, connections, streams)))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
