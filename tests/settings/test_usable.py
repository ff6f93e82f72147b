"""Configurations that are well formed and with which nothing can work."""

import os
from pathlib import Path

import pytest

from motionserver.errors import ConfigError
from motionserver.settings.config import load_config
from motionserver.settings.machine import load_machine
from motionserver.settings.resolve import resolve
from motionserver.settings.usable import doubts
from motionserver.supervisor.addresses import try_way


def sections(tmp_path, **changes):
    out = {"server": {"run_dir": str(tmp_path / "run"), "state_dir": str(tmp_path / "state")}}
    for name, value in changes.items():
        out[name] = {**out.get(name, {}), **value} if isinstance(value, dict) else value
    return out


def resolved(tmp_path, **changes):
    config = load_config(None, sections(tmp_path, **changes))
    return resolve(config, Path(config.server.run_dir))


def refusal(tmp_path, **changes):
    with pytest.raises(ConfigError) as caught:
        resolved(tmp_path, **changes)
    assert caught.value.do
    return str(caught.value)


ZENOH = {"kind": "zenoh", "listen": "127.0.0.1:7447"}


def zenoh(**more):
    return [{**ZENOH, **more}]


@pytest.mark.parametrize(
    ("where", "what", "changes"),
    [
        # words of the packets
        ("[platform] length_offset_m", "4.098", {"platform": {"length_offset_m": 5.0}}),
        ("[platform] length_offset_m", "stroke of", {"platform": {"length_offset_m": 1.1811}}),
        ("[platform] length_offset_m", "allowed is", {"platform": {"length_offset_m": 0.0009022}}),
        ("[platform] length_offset_m", "allowed is", {"platform": {"length_offset_m": 0.1}}),
        (
            "[platform] heave_neutral_m", "travel",
            {"platform": {"mode": "dof", "heave_neutral_m": 2.0}},
        ),
        ("[platform] head_m", "reference point", {"platform": {"head_m": [0.0, 0.0, 9.0]}}),
        # the platform's address
        ("[platform] host", "wildcard", {"platform": {"host": "0.0.0.0"}}),
        ("[platform] host", "wildcard", {"platform": {"host": "::"}}),
        ("[platform] host", "broadcast", {"platform": {"host": "255.255.255.255"}}),
        ("[platform] host", "broadcast", {"platform": {"host": "192.168.1.255"}}),
        ("[platform] host", "network's own", {"platform": {"host": "192.168.1.0"}}),
        ("[platform] host", "multicast", {"platform": {"host": "239.1.2.3"}}),
        ("[platform] host", "multicast", {"platform": {"host": "ff02::1"}}),
        ("[platform] host", "reserved", {"platform": {"host": "241.0.0.1"}}),
        ("[platform] host", "link-local", {"platform": {"host": "fe80::1"}}),
        ("[platform] host", "no IP address", {"platform": {"host": "moog"}}),
        ("[platform] local_host", "IPv4", {"platform": {"host": "::1"}}),
        ("[platform] local_host", "reaches", {"platform": {"host": "192.0.2.7"}}),
        ("[platform] local_port", "multicast", {"platform": {"local_host": "239.1.1.1"}}),
        # ports
        (
            "[platform] port", "as cues",
            {"platform": {"port": 4600}},
        ),
        (
            "[platform] port", "as cues",
            {"platform": {"port": 4600}, "sources": [{"listen": "0.0.0.0:4600",
                                                      "allow_unsigned": True}]},
        ),
        ("[platform] port", "answers", {"platform": {"port": 4444, "local_port": 4444}}),
        (
            "[[sources]] native 127.0.0.1:4444", "held by [platform] local_port",
            {"platform": {"local_port": 4444}, "sources": [{"listen": "127.0.0.1:4444"}]},
        ),
        (
            "[web] port", "held by [[sources]] zenoh",
            {"web": {"port": 7447}, "sources": zenoh()},
        ),
        # sources
        ("[[sources]]", "no source of cues", {"sources": []}),
        ("[[sources]]", "only sensors", {"sources": [{"kind": "imu"}]}),
        ("[[sources]] native", "held by", {"sources": [{}, {}]}),
        (
            "[[sources]] beamng", "held by",
            {"sources": [{"listen": "127.0.0.1:4600"},
                         {"kind": "beamng", "listen": "localhost:4600"}]},
        ),
        (
            "[[sources]] beamng", "held by",
            {"sources": [{"listen": "0.0.0.0:4600", "allow_unsigned": True},
                         {"kind": "beamng", "listen": "127.0.0.1:4600"}]},
        ),
        ("[[sources]] zenoh", "held by", {"sources": zenoh() * 2}),
        ("[[sources]] native 239.0.0.1", "multicast", {"sources": [{"listen": "239.0.0.1:4600",
                                              "allow_unsigned": True}]}),
        ("[[sources]] native 127.0.0.1:4600: topic", "kind", {"sources": [{"topic": "a/b"}]}),
        ("connect", "kind", {"sources": [{"connect": ["tcp/192.0.2.7:7447"]}]}),
        # keys of zenoh
        ("topic", "wildcards", {"sources": zenoh(topic="**")}),
        ("topic", "wildcards", {"sources": zenoh(topic="motion/*/in/cue")}),
        ("topic", "no single key", {"sources": zenoh(topic="motion/$0")}),
        ("topic", "no single key", {"sources": zenoh(topic="/motion/0")}),
        ("topic", "no single key", {"sources": zenoh(topic="motion//0")}),
        ("topic", "no single key", {"sources": zenoh(topic="motion/0/")}),
        ("topic", "no single key", {"sources": zenoh(topic="")}),
        ("preview_topic", "wildcards", {"sources": zenoh(preview_topic="motion/**")}),
        ("preview_topic", "status", {"sources": zenoh(preview_topic="motion/0/status")}),
        (
            "preview_topic", "cues",
            {"sources": [*zenoh(topic="a/in/cue"),
                         *zenoh(listen="127.0.0.1:7448", topic="b/in/cue",
                                preview_topic="a/in/cue")]},
        ),
        ("connect", "no endpoint", {"sources": zenoh(connect=["192.0.2.7:7447"])}),
        ("connect", "no endpoint", {"sources": zenoh(connect=["tcp/192.0.2.7"])}),
        ("connect", "no endpoint", {"sources": zenoh(connect=[""])}),
        # the rest
        ("[operator] enable_input", "No such file", {"operator": {"enable_input": "/nowhere/1"}}),
        ("[operator] enable_input", "a device", {"operator": {"enable_input": "/dev/zero"}}),
        ("[web] allowed_hosts", "host name", {"web": {"allowed_hosts": ["https://sim.lan"]}}),
        ("[web] allowed_hosts", "host name", {"web": {"allowed_hosts": ["sim.lan:8080"]}}),
        ("[web] allowed_hosts", "host name", {"web": {"allowed_hosts": ["*"]}}),
    ],
)  # fmt: skip
def test_configuration_with_which_nothing_can_work_is_refused(tmp_path, where, what, changes):
    text = refusal(tmp_path, **changes)
    assert where in text
    assert what in text


def test_folders_that_delete_each_other_are_refused(tmp_path):
    for run, state in (("run", "run"), ("run", "run/state"), ("state/blackbox", "state")):
        text = refusal(
            tmp_path, server={"run_dir": str(tmp_path / run), "state_dir": str(tmp_path / state)}
        )
        assert "[server] state_dir" in text
    (tmp_path / "file").write_text("mine")
    assert "no folder" in refusal(tmp_path, server={"state_dir": str(tmp_path / "file")})


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"platform": {"length_offset_m": 0.9}},
        {"platform": {"length_offset_m": 0.9022}},
        {"platform": {"mode": "dof", "heave_neutral_m": 0.0}},
        {"platform": {"host": "192.0.2.7", "local_host": "0.0.0.0", "port": 4600}},
        {"platform": {"host": "192.0.2.7", "local_host": "192.0.2.1"}},
        {"platform": {"host": "::1", "local_host": "::1"}},
        {"platform": {"local_port": 0}},
        {"web": {"port": 4600}},  # TCP beside UDP
        {"web": {"enabled": False, "port": 7447}, "sources": zenoh()},
        {"sources": [{}, {"kind": "imu", "listen": "127.0.0.1:4700"}, *zenoh()]},
        {"sources": zenoh(topic="sim/cue", preview_topic="sim/preview",
                          connect=["tcp/192.0.2.7:7447", "tls/[2001:db8::1]:7447"])},
        {"web": {"allowed_hosts": ["simulator.lan", "[2001:db8::1]"]}},
    ],
)  # fmt: skip
def test_configuration_that_can_work_is_taken(tmp_path, changes):
    resolved(tmp_path, **changes)


def test_home_of_a_path_is_written_out(tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path))
    (tmp_path / "switch").write_text("0\n")
    found = resolved(tmp_path, web={"tokens_file": "~/t.json"},
                     operator={"enable_input": "~/switch"})  # fmt: skip
    assert found["web"]["tokens_file"] == str(tmp_path / "t.json")
    assert found["enable_input"] == str(tmp_path / "switch")


@pytest.mark.skipif(os.getuid() == 0, reason="root reads everything")
def test_enable_input_that_may_not_be_read_is_refused(tmp_path):
    (tmp_path / "switch").write_text("1")
    (tmp_path / "switch").chmod(0)
    assert "may not read" in refusal(tmp_path, operator={"enable_input": str(tmp_path / "switch")})


@pytest.mark.parametrize(
    ("words", "changes"),
    [
        ("scale = 0", {"cueing": {"scale": 0.0}}),
        ("length_offset_m = 0", {"platform": {"length_offset_m": 0.0}}),
        ("vehicle_head_m is 9 m", {"cueing": {"vehicle_head_m": [9.0, 0.0, 0.0]}}),
        ("port 0 is any free one", {"sources": [{"listen": "127.0.0.1:0"}]}),
        ("only the console", {"operator": {"engage": "http"}, "web": {"enabled": False}}),
    ],
)
def test_configuration_that_is_probably_not_meant_is_taken_with_a_doubt(tmp_path, words, changes):
    resolved(tmp_path, **changes)
    config = load_config(None, sections(tmp_path, **changes))
    found = list(doubts(config, load_machine("t2-compact")))
    assert len(found) == 1
    assert words in found[0]
    assert not list(doubts(load_config(None, sections(tmp_path)), load_machine("t2-compact")))


def test_broadcast_address_of_a_network_here_is_told_by_the_kernel():
    with pytest.raises(ConfigError, match="broadcast address of a network here"):
        try_way("127.255.255.255", 991)
    try_way("127.0.0.1", 991)
    try_way("::1", 991)
