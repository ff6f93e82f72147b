"""The real process with TLS: the page, its stream and a change over https; nothing over http."""

import json
import socket
import ssl
import subprocess
import sys

import pytest
from browser.scene import TOKENS, t2_compact, write_configuration
from rig import cli
from web_process import Process, make_certificate

OPERATOR = f"Bearer {TOKENS['operator']}"


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    folder = tmp_path_factory.mktemp("tls")
    cert, key, context = make_certificate(folder, "127.0.0.1", "localhost")
    with Process(folder, context, tls_cert=str(cert), tls_key=str(key)) as process:
        yield process


def test_the_page_and_its_files_come_over_https(site):
    for path in ("/", "/static/app.js", "/healthz"):
        with site.ask("GET", path) as answer:
            assert answer.status == 200
            assert answer.read()
            assert answer.headers["strict-transport-security"] == "max-age=31536000"
            assert answer.headers["content-security-policy"].startswith("default-src 'self'")
            assert "server" not in answer.headers


def test_the_stream_comes_over_https(site):
    with site.ask("GET", "/api/stream", Authorization=OPERATOR) as answer:
        assert answer.headers["content-type"].startswith("text/event-stream")
        events = []
        while len(events) < 3:
            line = answer.readline()
            if line.startswith(b"data: "):
                events.append(json.loads(line[6:]))
    assert [event["state"] for event in events] == ["PARKED"] * 3
    assert events[0]["t_ns"] < events[1]["t_ns"] < events[2]["t_ns"]


def test_a_change_needs_a_token_and_the_own_origin(site):
    own = {"Origin": f"https://127.0.0.1:{site.port}", "Sec_Fetch_Site": "same-origin"}
    assert site.status("POST", "/api/park", **own) == 401
    assert site.status("POST", "/api/park", Authorization=OPERATOR, **own) == 200
    plain = {"Origin": f"http://127.0.0.1:{site.port}"}
    assert site.status("POST", "/api/park", Authorization=OPERATOR, **plain) == 403
    assert site.status("POST", "/api/engage", Authorization=OPERATOR, **plain) == 403
    assert site.scene.state == "PARKED"
    assert site.status("POST", "/api/engage", Authorization=OPERATOR, **own) == 200
    assert site.scene.state == "RAISING"


def test_plain_http_gets_no_answer(site):
    with socket.create_connection(("127.0.0.1", site.port), 30.0) as link:
        link.sendall(b"GET /healthz HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n")
        answer = b""
        try:
            while part := link.recv(4096):
                answer += part
        except ConnectionResetError:
            pass
    assert b"HTTP/" not in answer


@pytest.mark.parametrize(
    "version", [ssl.TLSVersion.TLSv1_1, ssl.TLSVersion.TLSv1_2, ssl.TLSVersion.TLSv1_3]
)
def test_only_tls_of_today(site, version):
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
    context.set_ciphers("ALL:@SECLEVEL=0")
    if version is ssl.TLSVersion.TLSv1_1:
        with pytest.warns(DeprecationWarning, match="TLSv1_1"):
            context.minimum_version = context.maximum_version = version
    else:
        context.minimum_version = context.maximum_version = version
    with socket.create_connection(("127.0.0.1", site.port), 30.0) as link:
        if version is ssl.TLSVersion.TLSv1_1:
            with pytest.raises((ssl.SSLError, ConnectionError)):
                context.wrap_socket(link)
        else:
            with context.wrap_socket(link) as secure:
                assert secure.version() == version.name.replace("_", ".")


def test_a_certificate_that_is_not_believed_ends_the_connection(site):
    with (
        socket.create_connection(("127.0.0.1", site.port), 30.0) as link,
        pytest.raises(ssl.SSLCertVerificationError),
    ):
        ssl.create_default_context().wrap_socket(link, server_hostname="127.0.0.1")


@pytest.mark.parametrize(
    ("host", "lacks"), [("0.0.0.0", "certificate"), ("::", "tokens"), ("192.0.2.4", "both")]
)
def test_the_process_refuses_an_open_address_without_certificate_or_tokens(tmp_path, host, lacks):
    cert, key, _ = make_certificate(tmp_path, "127.0.0.1")
    more = {"tls_cert": str(cert), "tls_key": str(key)} if lacks == "tokens" else {}
    path = write_configuration(tmp_path, 0, t2_compact(), host=host, **more)
    if lacks != "certificate":
        (tmp_path / "tokens.json").unlink()
    done = subprocess.run(
        [sys.executable, "-c", "import sys; from motionserver.web.main import main; "
         "sys.exit(main(sys.argv[1:]))", str(path)],
        env={"PYTHONPATH": ":".join(sys.path)}, capture_output=True, text=True, timeout=120,
        check=False,
    )  # fmt: skip
    assert done.returncode == 2
    assert host in done.stderr
    assert "tls_cert" in done.stderr
    assert "127.0.0.1" in done.stderr
    assert not (tmp_path / "tokens.json").exists() or lacks == "certificate"


@pytest.mark.parametrize("verb", ["check", "run"])
def test_the_whole_server_refuses_it_too_before_anything_moves(tmp_path, verb):
    path = tmp_path / "open.toml"
    path.write_text(
        f'[server]\nrun_dir = "{tmp_path}/run"\nstate_dir = "{tmp_path}/state"\n'
        f'[platform]\nlocal_port = 0\n[web]\nhost = "0.0.0.0"\n'
    )
    done = cli(verb, str(path))
    assert done.returncode == 2
    assert "0.0.0.0" in done.stderr
    assert "tls_cert" in done.stderr
    assert not (tmp_path / "state").exists()
