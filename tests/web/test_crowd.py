"""Many requests at once: the rest is told to wait, and parking still gets through."""

import asyncio
import threading
import time

from browser.scene import TOKENS
from web_world import World, ask_app

from motionserver.web.gate import MOST_AT_ONCE
from motionserver.web.requests import Peer

HEADERS = [("host", "127.0.0.1:8080"), ("authorization", f"Bearer {TOKENS['operator']}")]


async def test_requests_at_once_are_bounded_and_parking_finds_room(tmp_path):
    world = World(tmp_path)
    hold, answer = threading.Event(), world.scene.answer_planner
    world.scene.answer_planner = lambda request: hold.wait(30) and answer(request)
    try:
        waiting = [
            asyncio.create_task(ask_app(world.app, "GET", "/api/tuning", HEADERS))
            for _ in range(MOST_AT_ONCE)
        ]
        await asyncio.sleep(0)
        late = await ask_app(world.app, "GET", "/api/status", HEADERS)
        assert late.status == 503
        assert late.headers["retry-after"] == "1"
        assert (await ask_app(world.app, "GET", "/", HEADERS[:1])).status in (200, 503)
        stranger = await ask_app(world.app, "POST", "/api/park", HEADERS[:1])
        assert stranger.status == 401
        parked = await asyncio.wait_for(ask_app(world.app, "POST", "/api/park", HEADERS), 10)
        assert parked.status == 200
    finally:
        hold.set()
    assert {one.status for one in await asyncio.gather(*waiting)} == {200}
    assert (await ask_app(world.app, "GET", "/api/status", HEADERS)).status == 200


async def test_no_peer_waits_behind_the_other():
    hold = threading.Event()
    slow = Peer("planner", lambda request: hold.wait(30) and {"ok": True})
    quick = Peer("guard", lambda request: {"ok": True, "at": time.monotonic()})
    try:
        stuck = [asyncio.create_task(slow.ask({}, "/")) for _ in range(100)]
        await asyncio.sleep(0)
        assert (await asyncio.wait_for(quick.ask({}, "/"), 10))["ok"]
    finally:
        hold.set()
    await asyncio.gather(*stuck)
