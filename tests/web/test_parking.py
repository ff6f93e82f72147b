"""Parking: any role, as often as wanted, whatever else is refused at that moment."""

import fcntl

import pytest
from browser.scene import TOKENS
from web_world import AWAY, HERE, World

from motionserver.web.attempts import MOST


@pytest.fixture
def world(tmp_path):
    return World(tmp_path)


@pytest.mark.parametrize("role", TOKENS)
@pytest.mark.parametrize("peer", [HERE, AWAY], ids=["here", "away"])
def test_any_role_parks_as_often_as_it_wants(world, role, peer):
    client = world.client(role, peer)
    answers = [client.post("/api/park") for _ in range(300)]
    assert {answer.status_code for answer in answers} == {200}
    assert all(answer.json()["ok"] for answer in answers)
    assert world.asked == [{"op": "park", "by": "http"}] * 300


@pytest.mark.parametrize("state", ["OFFLINE", "PARKED", "RAISING", "READY", "RUN", "HOLD",
                                   "PARKING", "FAULT", "SAFE"])  # fmt: skip
def test_parking_twice_is_parking_once(world, state):
    world.scene.state = state
    first, second = (world.client("viewer").post("/api/park") for _ in range(2))
    assert (first.status_code, second.status_code) == (200, 200)
    assert first.json() == second.json()


def test_no_budget_that_is_used_up_holds_parking_up(world):
    tuner = world.client("tuner", AWAY)
    # on a clock that stands still two changes are all that a second has
    world.time, world.now = 0.0, lambda: 0.0
    world.scene.book._now = lambda: 0.0
    got = []
    for scale in (0.1, 0.2, 0.3, 0.4):
        tag = {"if-match": f'"{world.scene.book.version}"'}
        got.append(tuner.patch("/api/tuning", json={"scale": scale}, headers=tag).status_code)
    assert got[-1] == 429
    guesser = world.client(peer=AWAY)
    for number in range(3 * MOST):
        guesser.post("/api/park", headers={"authorization": f"Bearer {number:064d}"})
    assert guesser.post("/api/park", headers={"authorization": "Bearer x"}).status_code == 429
    for role in TOKENS:
        assert world.client(role, AWAY).post("/api/park").status_code == 200


@pytest.mark.parametrize("trouble", ["locked", "gone"])
def test_an_audit_log_that_cannot_be_written_does_not_hold_parking_up(world, trouble):
    path = world.config.audit_file
    if trouble == "gone":
        path.mkdir()
    with path.with_name(path.name + ".lock").open("ab") as held:
        if trouble == "locked":
            fcntl.flock(held, fcntl.LOCK_EX)
        assert world.client("viewer").post("/api/park").status_code == 200
