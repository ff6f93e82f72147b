"""A Zenoh input: the same bytes as over UDP, published on one key."""

from __future__ import annotations

import json
import time
from collections import deque
from typing import Final

import zenoh

DEPTH: Final = 64


def zenoh_config(listen: list[str], connect: list[str], file: str = "") -> zenoh.Config:
    """A configuration that talks to named endpoints only.

    Zenoh's defaults listen on all interfaces, scout by multicast and accept messages of a
    gigabyte; none of that belongs beside a machine.

    Args:
        listen: Endpoints to listen on, such as tcp/127.0.0.1:7447.
        connect: Endpoints to connect to.
        file: Zenoh's own file with certificates, passwords and access list; "" for none. What
            stands there about endpoints, scouting and sizes does not count.

    Raises:
        zenoh.ZError: The file cannot be read.
    """
    config = zenoh.Config.from_file(file) if file else zenoh.Config()
    for key, value in (
        ("mode", "peer"),
        ("listen/endpoints", listen),
        ("connect/endpoints", connect),
        ("scouting/multicast/enabled", False),
        ("scouting/gossip/enabled", False),
        ("transport/link/tx/lease", 1000),
        ("transport/link/rx/max_message_size", 65536),
        ("transport/unicast/max_sessions", 16),
    ):
        config.insert_json5(key, json.dumps(value))
    return config


def link_of(file: str) -> str:
    """Kind of link to listen on: "tls" if ``file`` names a certificate, else "tcp".

    Raises:
        OSError: The file cannot be read.
    """
    if not file:
        return "tcp"
    try:
        named = zenoh.Config.from_file(file).get_json("transport/link/tls/listen_certificate")
    except zenoh.ZError as error:
        raise OSError(f"zenoh_config {file}: {error}") from error
    return "tcp" if json.loads(named) is None else "tls"


class ZenohInput:
    """A subscriber whose callback only stores; the tick reads.

    The newest `DEPTH` samples are kept, so a flood cannot grow memory nor wake the loop.
    """

    def __init__(
        self,
        topic: str,
        listen: list[str],
        connect: list[str],
        preview_topic: str = "",
        file: str = "",
    ) -> None:
        """Open the session and subscribe.

        Args:
            topic: Key of the cues.
            listen: Endpoints to listen on.
            connect: Endpoints to connect to.
            preview_topic: Key on which previews are put, apart from the cues; "" for none.
            file: Zenoh's own file with certificates, passwords and access list; "" for none.

        Raises:
            OSError: An endpoint or the key cannot be used.
        """
        self._slot: deque[tuple[bytes, str, int]] = deque(maxlen=DEPTH)
        self._previews: deque[tuple[bytes, str, int]] = deque(maxlen=DEPTH)
        self._topic = topic
        try:
            self._session = zenoh.open(zenoh_config(listen, connect, file))
            self._subscribers = [self._session.declare_subscriber(topic, self._take)]
            if preview_topic:
                self._subscribers.append(
                    self._session.declare_subscriber(preview_topic, self._take_preview)
                )
        except zenoh.ZError as error:
            raise OSError(f"zenoh on {', '.join(listen)}, key {topic!r}: {error}") from error

    def _take(self, sample: zenoh.Sample) -> None:
        self._slot.append(_told(sample))

    def _take_preview(self, sample: zenoh.Sample) -> None:
        self._previews.append(_told(sample))

    def drain(self) -> list[tuple[bytes, str, int]]:
        """Samples that wait: bytes, key as text, arrival [ns]."""
        return _emptied(self._slot)

    def drain_previews(self) -> list[tuple[bytes, str, int]]:
        """Samples of the preview's own key that wait, likewise."""
        return _emptied(self._previews)

    def reply(self, name: str, data: bytes) -> None:
        """Publish the status beside the cue, on .../status."""
        self._session.put(f"{self._topic.rsplit('/in/', 1)[0]}/status", data)

    def close(self) -> None:
        """Leave."""
        for subscriber in self._subscribers:
            subscriber.undeclare()  # type: ignore[no-untyped-call]
        self._session.close()  # type: ignore[no-untyped-call]


def _told(sample: zenoh.Sample) -> tuple[bytes, str, int]:
    return sample.payload.to_bytes(), f"zenoh:{sample.key_expr}", time.monotonic_ns()


def _emptied(slot: deque[tuple[bytes, str, int]]) -> list[tuple[bytes, str, int]]:
    # the callback goes on storing meanwhile: take what is there now, no more
    return [slot.popleft() for _ in range(len(slot))]
