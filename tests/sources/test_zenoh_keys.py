"""Cues and previews come by keys of their own, and do not mix."""

import json
import socket
import time

import zenoh

from motionserver.sources.zenoh_input import ZenohInput


def _free_port() -> int:
    with socket.socket() as link:
        link.bind(("127.0.0.1", 0))
        port: int = link.getsockname()[1]
        return port


def _client(endpoint: str) -> zenoh.Session:
    config = zenoh.Config()
    for key, value in (
        ("mode", "client"),
        ("connect/endpoints", [endpoint]),
        ("scouting/multicast/enabled", False),
    ):
        config.insert_json5(key, json.dumps(value))
    return zenoh.open(config)


def test_each_key_has_its_own_queue() -> None:
    endpoint = f"tcp/127.0.0.1:{_free_port()}"
    room = ZenohInput("t/in/cue", [endpoint], [], "t/in/preview")
    sender = _client(endpoint)
    cues: list[bytes] = []
    previews: list[bytes] = []
    try:
        until = time.monotonic() + 20.0
        while not (cues and previews) and time.monotonic() < until:
            sender.put("t/in/cue", b"cue")
            sender.put("t/in/preview", b"preview")
            cues += [data for data, _, _ in room.drain()]
            previews += [data for data, _, _ in room.drain_previews()]
    finally:
        sender.close()
        room.close()
    assert set(cues) == {b"cue"}
    assert set(previews) == {b"preview"}
