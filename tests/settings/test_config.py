import re

import pytest

from motionserver.errors import ConfigError
from motionserver.settings.config import load_config, run_dir_of, split_address, state_dir_of


def wrong(tmp_path, text, overrides=None):
    path = tmp_path / "c.toml"
    path.write_text(text)
    with pytest.raises(ConfigError) as caught:
        load_config(path, overrides)
    return caught.value


def test_the_defaults_run_on_loopback():
    config = load_config(None)
    assert config.platform.host == config.web.host == "127.0.0.1"
    assert config.operator.engage == "console"
    assert [source.kind for source in config.sources] == ["native"]


@pytest.mark.parametrize(
    ("text", "where", "what"),
    [
        ("[platform]\nprt = 5\n", "c.toml:2: platform.prt", "Did you mean 'port'?"),
        ("[platfrom]\nport = 5\n", "c.toml:1: platfrom", "Did you mean 'platform'?"),
        ("[platform]\nqqqq = 5\n", "c.toml:2: platform.qqqq", "Allowed: engage_word, format"),
        ("[platform]\nport = 0\n", "c.toml:2: platform.port", "greater than or equal to 1"),
        ("[platform]\nport = 70000\n", "c.toml:2: platform.port", "65535"),
        ("[platform]\nport = 'x'\n", "c.toml:2: platform.port", "valid integer"),
        ("[platform]\nrate_hz = 5\n", "c.toml:2: platform.rate_hz", "20"),
        ("[platform]\nrate_hz = nan\n", "c.toml:2: platform.rate_hz", "found nan"),
        ("[platform]\nmode = 'pose'\n", "c.toml:2: platform.mode", "'length' or 'dof'"),
        ("[platform]\nengage_word = 178\n", "c.toml:2: platform.engage_word", "175 or 180"),
        ("[platform]\nleg_order = [0,1,2,3,4,4]\n", "c.toml:2: platform.leg_order", "each once"),
        ("[platform]\nhead_m = [0, 0, inf]\n", "c.toml:2: platform.head_m.2", "finite"),
        ("[platform]\nhead_m = [0, 0, 1200]\n", "c.toml:2: platform.head_m.2", "10"),
        ("[platform]\nhead_mm = [0, 0, 1]\n", "c.toml:2: platform.head_mm", "'head_m'"),
        ("[cueing]\nscale = 1.5\n", "c.toml:2: cueing.scale", "less than or equal to 1"),
        ("[cueing]\nvehicle_head_m = [0, nan, 0]\n", "c.toml:2: cueing.vehicle_head_m.1", "finite"),
        ("[web]\nport = true\n", "c.toml:2: web.port", "true and false are no numbers"),
        ("[platform]\nhead_m = true\n", "c.toml:2: platform.head_m", "no numbers"),
        ("[cueing]\nscale = false\n", "c.toml:2: cueing.scale", "no numbers"),
        ("[web]\nport = -1\n", "c.toml:2: web.port", "greater than or equal to 0"),
        ("[operator]\nengage = 'me'\n", "c.toml:2: operator.engage", "'console', 'http' or 'auto'"),
        ("[[sources]]\nlisten = 'here'\n", "c.toml:2: sources.0.listen", "HOST:PORT"),
        ("[[sources]]\nlisten = ':5'\n", "c.toml:2: sources.0.listen", "HOST:PORT"),
        ("[[sources]]\nlisten = 'a:65536'\n", "c.toml:2: sources.0.listen", "HOST:PORT"),
        ("[[sources]]\nlissten = ''\n", "c.toml:2: sources.0.lissten", "'listen'"),
        ("[[sources]]\nzzzz = ''\n", "c.toml:2: sources.0.zzzz", "Allowed: allow_unsigned"),
        ("[[sources]]\npreview_topic = 'p'\n", "sources.0", 'needs kind = "zenoh"'),
        (
            "[[sources]]\nkind = 'zenoh'\npreview_topic = 'motion/0/in/cue'\n",
            "sources.0",
            "must differ from topic",
        ),
        ("sources = 5\n", "c.toml:1: sources", "list"),
        ("web = 5\n", "c.toml:1: web", "WebSection"),
        ("web.port = 'x'\n", "web.port", "integer"),
        ("[platForm]\nport = 5\n", "c.toml: platForm", "Did you mean 'platform'?"),
        ("[web]\n7 = 1\n", "c.toml:2: web.7", "Allowed: allowed_hosts"),
        (f"[web]\n{'9' * 4400} = 1\n", "c.toml:2: web.999", "unknown key"),
        (f"{'9' * 4400} = 1\n", "c.toml:1: 999", "unknown key"),
    ],
)
def test_what_is_wrong_is_told_with_file_line_key_and_cure(tmp_path, text, where, what):
    found = str(wrong(tmp_path, text))
    assert where in found
    assert what in found


def test_the_line_is_the_one_of_its_own_section(tmp_path):
    text = "[platform]\nhost = '1'\nport = 5\n\n[web]\nhost = '2'\n# port = 9\nport = -4\n"
    assert "c.toml:8: web.port" in str(wrong(tmp_path, text))
    text = "[[sources]]\nlisten = '1.2.3.4:5'\n[[sources]]\nlisten = 'bad'\n"
    assert "c.toml:4: sources.1.listen" in str(wrong(tmp_path, text))


def test_more_than_one_mistake_is_counted(tmp_path):
    assert "(1 more after this one)" in str(wrong(tmp_path, "[web]\nport = -1\nnope = 2\n"))


def test_files_that_cannot_be_read(tmp_path):
    with pytest.raises(ConfigError, match="cannot be read"):
        load_config(tmp_path / "none.toml")
    with pytest.raises(ConfigError, match="cannot be read"):
        load_config(tmp_path)
    assert "not TOML" in str(wrong(tmp_path, "[web\n"))
    (tmp_path / "b.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ConfigError, match="not TOML"):
        load_config(tmp_path / "b.toml")


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("a = " + "[" * 3000, "not TOML: brackets nested too deeply"),
        ("[web]\nport = " + "9" * 5000, "not TOML: Exceeds the limit"),
        ("_env_file = '/dev/null'", "unknown key '_env_file'"),
        ("_cli_parse_args = true", "unknown key '_cli_parse_args'"),
        ("__pydantic_self__ = 1", "unknown key '__pydantic_self__'"),
        ('[platform]\npreset = "a\\u0000.toml"', "platform.preset: .* NUL"),
        ('[[sources]]\nkey_file = "a\\u0000"', "key_file: .* NUL"),
        ('[server]\nrun_dir = "~nobody-here/x"', "server.run_dir: .* no user"),
        ('[[sources]]\nkey_file = "~nobody-here/x"', "key_file: .* no user"),
        ('[[sources]]\nlisten = "127.0.0.1:²"', "HOST:PORT"),
        ('[[sources]]\nlisten = "127.0.0.1:٤٦"', "HOST:PORT"),
        (f'[[sources]]\nlisten = "127.0.0.1:{"9" * 5000}"', "HOST:PORT"),
    ],
)
def test_what_nobody_writes_by_mistake(tmp_path, text, expected):
    message = str(wrong(tmp_path, text))
    assert re.search(expected, message)
    assert "c.toml" in message
    assert len(message) < 400


def test_overrides_leave_their_neighbours_alone(tmp_path):
    path = tmp_path / "c.toml"
    path.write_text("[platform]\nport = 5\nrate_hz = 100\n[web]\nport = 7\n")
    config = load_config(path, {"platform": {"port": 6}, "web": {"enabled": False}})
    assert (config.platform.port, config.platform.rate_hz) == (6, 100.0)
    assert (config.web.port, config.web.enabled) == (7, False)
    assert "platform.port" in str(wrong(tmp_path, "", {"platform": {"port": 0}}))


def test_the_environment_wins(tmp_path, monkeypatch):
    path = tmp_path / "c.toml"
    path.write_text("[platform]\nport = 5\nrate_hz = 100\n")
    monkeypatch.setenv("MOTIONSERVER_PLATFORM__PORT", "9")
    config = load_config(path)
    assert (config.platform.port, config.platform.rate_hz) == (9, 100.0)
    monkeypatch.setenv("MOTIONSERVER_PLATFORM__PORT", "many")
    with pytest.raises(ConfigError, match="found 'many'"):
        load_config(path)
    monkeypatch.delenv("MOTIONSERVER_PLATFORM__PORT")
    monkeypatch.setenv("MOTIONSERVER_SOURCES", "{not json")
    with pytest.raises(ConfigError, match="MOTIONSERVER_"):
        load_config(path)


@pytest.mark.parametrize(
    ("text", "expected"), [("a:1", ("a", 1)), ("[::1]:4600", ("::1", 4600)), ("0.0.0.0:0", None)]
)
def test_addresses(text, expected):
    assert split_address(text) == (expected or ("0.0.0.0", 0))


@pytest.mark.parametrize("text", ["", "a", "a:", ":1", "a:-1", "a:1.5", "a:65536"])
def test_what_is_no_address(text):
    with pytest.raises(ValueError, match="HOST:PORT"):
        split_address(text)


def test_directories(monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_RUNTIME_DIR", "/run/user/7")
    monkeypatch.setenv("XDG_STATE_HOME", "/home/x/state")
    config = load_config(None)
    assert str(run_dir_of(config)) == "/run/user/7/motionserver-992"
    assert str(state_dir_of(config)) == "/home/x/state/motionserver"
    monkeypatch.delenv("XDG_RUNTIME_DIR")
    assert "/motionserver-992" in str(run_dir_of(config))
    own = load_config(None, {"server": {"run_dir": "/a", "state_dir": "/b"}})
    assert (str(run_dir_of(own)), str(state_dir_of(own))) == ("/a", "/b")
