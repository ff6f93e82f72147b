"""The shipped Zenoh file, with real sessions: the right simulator moves cues, nobody else does."""

import json
import socket
import threading
import time
from pathlib import Path

import pytest
import trustme
import zenoh
from motion_protocol import Cue, Motion, encode_cue

from motionserver.planner.inputs import Inputs, open_input
from motionserver.planner.options import InputOptions
from motionserver.sources.zenoh_input import link_of

SHIPPED = Path(__file__).parents[2] / "deploy" / "zenoh-secure.json5"
PASSWORDS = {"simulator": "s" * 32, "guest": "g" * 32}
PATIENCE = 20.0


def free_port():
    with socket.socket() as link:
        link.bind(("127.0.0.1", 0))
        return link.getsockname()[1]


def issue(folder, authority, name, *identities):
    made = authority.issue_cert(*identities, common_name=name)
    made.private_key_pem.write_to_path(folder / f"{name}.key")
    made.cert_chain_pems[0].write_to_path(folder / f"{name}.pem")


class House:
    """The server's input as the planner opens it, and what it takes."""

    def __init__(self, folder):
        own, foreign = trustme.CA(), trustme.CA()
        own.cert_pem.write_to_path(folder / "authority.pem")
        issue(folder, own, "server", "127.0.0.1")
        issue(folder, own, "simulator", "simulator@example.org")
        issue(folder, own, "guest", "guest@example.org")
        (folder / "foreign").mkdir()
        issue(folder / "foreign", foreign, "simulator", "simulator@example.org")
        users = "".join(f"{name}:{password}\n" for name, password in PASSWORDS.items())
        (folder / "users").write_text(users)
        text = SHIPPED.read_text("utf-8")
        assert text.count("/etc/motionserver/zenoh/") == 4
        self.file = folder / "zenoh.json5"
        self.file.write_text(text.replace("/etc/motionserver/zenoh/", f"{folder}/"))
        self.folder, self.port = folder, free_port()
        options = InputOptions(
            "zenoh", "127.0.0.1", self.port, None, "motion/0/in/cue", (), "motion/0/in/preview",
            str(self.file),
        )  # fmt: skip
        self.inputs = Inputs([open_input(options)], lambda: True)
        self.sequence = 0

    def client(self, *, user, password=None, certificate=None, link="tls"):
        """A simulator's session; None if it is not let in."""
        config = zenoh.Config()
        tls = {"root_ca_certificate": str(self.folder / "authority.pem")}
        if certificate is not None:
            stem = self.folder / certificate
            tls |= {
                "connect_private_key": f"{stem}.key",
                "connect_certificate": f"{stem}.pem",
                "enable_mtls": True,
            }
        for key, value in (
            ("mode", "client"),
            ("connect/endpoints", [f"{link}/127.0.0.1:{self.port}"]),
            ("connect/timeout_ms", 3000),
            ("scouting/multicast/enabled", False),
            ("transport/link/tls", tls),
            *([("transport/auth/usrpwd/user", user)] if user else []),
            *([("transport/auth/usrpwd/password", password or PASSWORDS[user])] if user else []),
        ):
            config.insert_json5(key, json.dumps(value))
        try:
            return zenoh.open(config)
        except zenoh.ZError:
            return None

    def cue(self):
        self.sequence += 1
        now = time.monotonic_ns()
        return encode_cue(Cue(9, self.sequence, now, now, Motion((1.0, 0.0, 0.0), (0.0,) * 3)))

    def takes_from(self, session, key="motion/0/in/cue", patience=PATIENCE):
        """Whether a cue on ``key`` arrives, put again and again."""
        pause, until = threading.Event(), time.monotonic() + patience
        while time.monotonic() < until:
            session.put(key, self.cue())
            pause.wait(0.02)
            vehicle, _ = self.inputs.poll()
            if vehicle:
                return True
        return False


@pytest.fixture(scope="module")
def house(tmp_path_factory):
    made = House(tmp_path_factory.mktemp("zenoh"))
    yield made
    made.inputs.close()


def test_the_right_simulator_moves_cues_and_is_told_the_status(house):
    session = house.client(user="simulator", certificate="simulator")
    try:
        told = []
        listener = session.declare_subscriber("motion/0/status", told.append)
        assert house.takes_from(session)
        until = time.monotonic() + PATIENCE
        while not told and time.monotonic() < until:
            assert house.takes_from(session)
            house.inputs.reply(b"status")
        assert told
        listener.undeclare()
    finally:
        session.close()


@pytest.mark.parametrize(
    "who",
    [
        {"user": "simulator", "password": "wrong", "certificate": "simulator"},
        {"user": "nobody", "password": "s" * 32, "certificate": "simulator"},
        {"user": None, "certificate": "simulator"},
        {"user": "simulator", "certificate": None},
        {"user": "simulator", "certificate": "foreign/simulator"},
        {"user": "simulator", "certificate": "simulator", "link": "tcp"},
    ],
)
def test_a_stranger_is_not_let_in(house, who):
    assert house.client(**who) is None


@pytest.mark.parametrize(
    "who",
    [
        {"user": "guest", "certificate": "guest"},
        {"user": "guest", "certificate": "simulator"},
        {"user": "simulator", "certificate": "guest"},
    ],
)
def test_who_is_let_in_but_is_not_the_simulator_moves_nothing(house, who):
    before = house.inputs.counters["packets"]
    session = house.client(**who)
    assert session is not None
    right = house.client(user="simulator", certificate="simulator")
    try:
        assert not house.takes_from(session, patience=1.0)
        assert not house.takes_from(session, "motion/0/in/preview", patience=0.5)
        assert house.inputs.counters["packets"] == before
        assert house.takes_from(right), "the right one would have been heard"
    finally:
        session.close()
        right.close()


def test_other_keys_are_closed_to_the_simulator_too(house):
    heard = []
    server = house.inputs.inputs[0].transport._session
    listener = server.declare_subscriber("**", lambda sample: heard.append(str(sample.key_expr)))
    session = house.client(user="simulator", certificate="simulator")
    try:
        for _ in range(20):
            session.put("motion/1/in/cue", house.cue())
            session.put("motion/0/status", b"lie")
            session.delete("motion/0/in/cue")
        assert house.takes_from(session)
        assert set(heard) == {"motion/0/in/cue"}
    finally:
        listener.undeclare()
        session.close()


def test_a_file_without_certificate_stays_with_tcp_and_a_missing_one_is_named(tmp_path):
    plain = tmp_path / "plain.json5"
    plain.write_text("{}")
    assert (link_of(""), link_of(str(plain))) == ("tcp", "tcp")
    with pytest.raises(OSError, match="nothing"):
        link_of(str(tmp_path / "nothing.json5"))
