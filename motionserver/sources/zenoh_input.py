"""A Zenoh input: the same bytes as over UDP, published on one key."""

from __future__ import annotations

import json
import time
from collections import deque
from typing import Final

import zenoh

DEPTH: Final = 64


def zenoh_config(listen: list[str], connect: list[str]) -> zenoh.Config:
    """A configuration that talks to named endpoints only.

    Zenoh's defaults listen on all interfaces, scout by multicast and accept messages of a
    gigabyte; none of that belongs beside a machine.

    Args:
        listen: Endpoints to listen on, such as tcp/127.0.0.1:7447.
        connect: Endpoints to connect to.
    """
    config = zenoh.Config()
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


class ZenohInput:
    """A subscriber whose callback only stores; the tick reads.

    The newest `DEPTH` samples are kept, so a flood cannot grow memory nor wake the loop.
    """

    def __init__(self, topic: str, listen: list[str], connect: list[str]) -> None:
        """Open the session and subscribe.

        Raises:
            OSError: An endpoint or the key cannot be used.
        """
        self._slot: deque[tuple[bytes, str, int]] = deque(maxlen=DEPTH)
        self._topic = topic
        try:
            self._session = zenoh.open(zenoh_config(listen, connect))
            self._subscriber = self._session.declare_subscriber(topic, self._take)
        except zenoh.ZError as error:
            raise OSError(f"zenoh on {', '.join(listen)}, key {topic!r}: {error}") from error

    def _take(self, sample: zenoh.Sample) -> None:
        self._slot.append(
            (sample.payload.to_bytes(), f"zenoh:{sample.key_expr}", time.monotonic_ns())
        )

    def drain(self) -> list[tuple[bytes, str, int]]:
        """Samples that wait: bytes, key as text, arrival [ns]."""
        # the callback goes on storing meanwhile: take what is there now, no more
        return [self._slot.popleft() for _ in range(len(self._slot))]

    def reply(self, name: str, data: bytes) -> None:
        """Publish the status beside the cue, on .../status."""
        self._session.put(f"{self._topic.rsplit('/in/', 1)[0]}/status", data)

    def close(self) -> None:
        """Leave."""
        self._subscriber.undeclare()  # type: ignore[no-untyped-call]
        self._session.close()  # type: ignore[no-untyped-call]
