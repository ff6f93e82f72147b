"""Cases made from the application's own OpenAPI document: valid ones, and ones that are not.

The campaign: ``pytest -m campaign tests/web/test_openapi_cases.py``.
"""

import asyncio
import logging
from pathlib import Path

import pytest
import schemathesis
from browser.scene import TOKENS
from hypothesis import HealthCheck, Phase, given, seed, settings
from hypothesis import strategies as st
from requests import Request
from schemathesis import GenerationMode
from web_world import AWAY, HERE, World, ask_app, every_route

PUBLIC = ("/", "/healthz")
EXPLAINED = {"error", "where", "allowed", "do"}


def cases(app, modes):
    document = schemathesis.openapi.from_dict(app.openapi())
    operations = [result.ok() for result in document.get_all_operations()]
    return st.one_of(
        [one.as_strategy(generation_mode=mode) for one in operations for mode in modes]
    )


def prepared(case):
    """Method, path, headers and body as they would go over the wire."""
    kwargs = case.as_transport_kwargs(base_url="http://127.0.0.1:8080")
    names = ("method", "url", "headers", "params", "json", "data", "files", "cookies")
    request = Request(**{name: kwargs[name] for name in names if name in kwargs}).prepare()
    body = request.body or b""
    body = body.encode() if isinstance(body, str) else body
    headers = {"host": "127.0.0.1:8080"}
    for name, value in request.headers.items():
        text = value if isinstance(value, str) else value.decode("latin-1")
        headers[name.lower()] = text.encode("utf-8").decode("latin-1")
    headers.setdefault("content-length", str(len(body)))
    return request.method, request.path_url, headers, body


def judge(world, case):
    method, path, headers, body = prepared(case)
    name = path.partition("?")[0]

    def ask(token=None, peer=HERE, **more):
        named = {k: v for k, v in headers.items() if k != "authorization"}
        if token:
            named |= {"authorization": f"Bearer {TOKENS[token]}", **more}
        answer = asyncio.run(ask_app(world.app, method, path, named.items(), body=body, peer=peer))
        assert answer.status < 500, answer
        if answer.status >= 400 and method != "HEAD":
            assert set(answer.json()) >= EXPLAINED, answer
        assert answer.headers["content-security-policy"]
        return answer

    before = world.state()
    here, away = ask(), ask(peer=AWAY)
    assert world.state() == before
    if method not in ("GET", "HEAD"):
        assert here.status in (400, 401, 403)
    if name not in PUBLIC:
        assert away.status in (400, 401, 403)
    ask("viewer", AWAY)
    if "/api/park" not in name:
        assert world.state() == before
    ask("operator")
    ask("operator", **{"if-match": f'"{world.scene.book.version}"'})


def run(folder, count, number, modes=(GenerationMode.POSITIVE, GenerationMode.NEGATIVE)):
    world = World(folder)
    seen = set()

    @seed(number)
    @settings(
        max_examples=count,
        deadline=None,
        database=None,
        phases=[Phase.generate, Phase.shrink],
        suppress_health_check=list(HealthCheck),
    )
    @given(case=cases(world.app, modes))
    def each(case):
        seen.add((case.method.upper(), case.operation.path))
        judge(world, case)

    each()
    return world, seen


def test_some_cases_of_every_operation(tmp_path):
    world, seen = run(tmp_path, 250, 7)
    wanted = {
        (method, path)
        for methods, path in every_route(world.app)
        for method in methods - {"HEAD"}
        if not path.startswith("/static")
    }
    assert wanted <= seen, wanted - seen
    assert world.scene.book.version > 1, "no change of the operator got through: too weak a test"


@pytest.mark.campaign
@pytest.mark.timeout(3600)
def test_ten_thousand_cases(tmp_path: Path):
    logging.disable(logging.CRITICAL)
    for number in range(10):
        folder = tmp_path / str(number)
        folder.mkdir()
        run(folder, 1000, number)
    print("10,000 cases: no 5xx, no change without a token")
