"""The link with the token: printed once, when the tokens are made, and not into a journal."""

import io
import json
import os
import stat
from urllib.parse import parse_qs, urlsplit

import pytest

from motionserver.cli.page_link import first_start_text, page_link, page_url
from motionserver.web.config import WebConfigError


@pytest.fixture
def web(tmp_path):
    return {
        "host": "127.0.0.1",
        "port": 8080,
        "tls_cert": None,
        "tokens_file": str(tmp_path / "state" / "tokens.json"),
    }


def test_the_first_start_prints_a_link_and_later_ones_only_the_place(web, tmp_path):
    first = first_start_text(web, io.StringIO())
    tokens = json.loads((tmp_path / "state" / "tokens.json").read_text("utf-8"))
    assert f"page http://127.0.0.1:8080/#token={tokens['operator']}\n" in first
    assert tokens["viewer"] not in first
    assert web["tokens_file"] in first
    assert stat.S_IMODE((tmp_path / "state" / "tokens.json").stat().st_mode) == 0o600
    second = first_start_text(web, io.StringIO())
    assert second == f"page http://127.0.0.1:8080, tokens in {web['tokens_file']}"


def test_a_token_does_not_go_into_the_journal(web, tmp_path, monkeypatch):
    with (tmp_path / "out").open("w") as output:
        about = os.fstat(output.fileno())
        monkeypatch.setenv("JOURNAL_STREAM", f"{about.st_dev}:{about.st_ino}")
        said = first_start_text(web, output)
    assert "#token" not in said
    assert web["tokens_file"] in said


def test_tokens_that_the_page_would_refuse_stop_the_start(web, tmp_path):
    first_start_text(web, io.StringIO())
    (tmp_path / "state" / "tokens.json").chmod(0o644)
    with pytest.raises(WebConfigError, match="chmod 600"):
        first_start_text(web, io.StringIO())


@pytest.mark.parametrize(
    ("change", "url"),
    [
        ({}, "http://127.0.0.1:8080"),
        ({"host": "::1"}, "http://[::1]:8080"),
        ({"tls_cert": "cert.pem"}, "https://127.0.0.1:8080"),
    ],
)
def test_the_address_is_one_a_browser_takes(web, change, url):
    assert page_url(web | change) == url


def test_a_link_carries_any_token(web):
    token = "a+b/c=d&e#f%20"
    fragment = urlsplit(page_link(page_url(web), token)).fragment
    assert parse_qs(fragment) == {"token": [token]}
