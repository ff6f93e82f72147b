import hashlib
import logging

import pytest
from browser.scene import TOKENS
from hypothesis import given, settings
from hypothesis import strategies as st
from web_world import AWAY, HERE, World

from motionserver.web import attempts
from motionserver.web.attempts import MOST, REFILL, Attempts, network_of


class Clock:
    def __init__(self):
        self.now = 1000.0

    def __call__(self):
        return self.now


def test_guesses_run_out_and_come_back():
    clock = Clock()
    door = Attempts(clock)
    for _ in range(MOST):
        assert door.wait("192.0.2.1") == 0.0
        door.wrong("192.0.2.1")
    assert door.wait("192.0.2.1") == pytest.approx(REFILL)
    assert door.wait("192.0.2.2") == 0.0
    clock.now += REFILL - 0.001
    assert door.wait("192.0.2.1") > 0.0
    clock.now += 0.001
    assert door.wait("192.0.2.1") == 0.0
    clock.now += 1e9
    for _ in range(MOST):
        door.wrong("192.0.2.1")
    assert door.wait("192.0.2.1") > 0.0


@given(st.lists(st.floats(0.0, 10.0), max_size=200))
@settings(max_examples=50, deadline=None)
def test_no_rhythm_of_guessing_gets_more_than_the_rate(pauses):
    clock = Clock()
    door = Attempts(clock)
    judged = 0
    for pause in pauses:
        clock.now += pause
        if door.wait("192.0.2.1") == 0.0:
            judged += 1
            door.wrong("192.0.2.1")
    assert judged <= MOST + sum(pauses) / REFILL + 1e-6


def test_one_ipv6_network_is_one_guesser():
    assert (
        network_of("2001:db8::1") == network_of("2001:db8::ffff:1") != network_of("2001:db8:0:1::1")
    )
    assert network_of("::ffff:192.0.2.1") == network_of("192.0.2.1")
    assert network_of("no address") == ""


def test_what_is_remembered_is_bounded():
    door = Attempts(Clock())
    for number in range(3000):
        door.wrong(f"10.0.{number // 250}.{number % 250}")
    assert len(door._left) == attempts._REMEMBERED
    assert "10.0.11.249" in door._left
    assert "10.0.0.0" not in door._left


def test_the_log_says_it_once_a_minute_and_never_the_token(caplog):
    clock = Clock()
    door = Attempts(clock)
    with caplog.at_level(logging.INFO):
        for _ in range(500):
            door.wrong("192.0.2.1")
            clock.now += 0.01
    assert len(caplog.records) == 1
    assert "192.0.2.1" in caplog.text


@pytest.fixture
def world(tmp_path):
    return World(tmp_path)


def guess(world, peer, times=MOST):
    client = world.client(peer=peer)
    return [
        client.get("/api/status", headers={"authorization": f"Bearer {n:064d}"}).status_code
        for n in range(times)
    ]


def test_a_guesser_waits_and_others_do_not(world):
    assert guess(world, AWAY) == [401] * MOST
    answer = world.client(peer=AWAY).get("/api/status", headers={"authorization": "Bearer no"})
    assert answer.status_code == 429
    assert 1 <= int(answer.headers["retry-after"]) <= REFILL
    assert {"error", "where", "allowed", "do"} <= set(answer.json())
    assert world.client("operator", HERE).get("/api/status").status_code == 200


@pytest.mark.parametrize("peer", [HERE, AWAY])
def test_right_token_never_used_before_passes_whatever_was_guessed(world, peer):
    guess(world, peer, 3 * MOST)
    for role in ("viewer", "tuner", "operator"):
        assert world.client(role, peer).get("/api/status").status_code == 200
    assert world.client("viewer", peer).post("/api/park").status_code == 200
    engage = world.client("operator", peer).post("/api/engage")
    assert engage.status_code != 429
    wrong = world.client(peer=peer, authorization=f"Bearer {TOKENS['viewer']}x")
    assert wrong.post("/api/park").status_code == 429


def test_short_token_behind_a_hash_waits_like_a_guess_but_may_park(tmp_path):
    short = "swordfish"
    hashed = "sha256:" + hashlib.sha256(short.encode()).hexdigest()
    world = World(tmp_path, tokens={**TOKENS, "operator": hashed})
    client = world.client(peer=AWAY, authorization=f"Bearer {short}")
    assert client.get("/api/status").status_code == 200
    guess(world, AWAY, MOST)
    assert client.get("/api/status").status_code == 429
    assert client.post("/api/park").status_code == 200


def test_without_a_token_nothing_is_counted(world):
    for _ in range(3 * MOST):
        assert world.client(peer=AWAY).get("/api/status").status_code == 401
    assert world.client("viewer", AWAY).get("/api/status").status_code == 200
