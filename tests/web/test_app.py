import fcntl
import json
import math
import time

import pytest
from browser.scene import TOKENS
from prometheus_client.parser import text_string_to_metric_families
from starlette.testclient import TestClient
from web_world import AWAY, HERE, MACHINE, NONE, Newest, World

from motionserver.settings.tuning_book import TuningBook
from motionserver.web.app import build_app


@pytest.fixture
def world(tmp_path):
    return World(tmp_path)


def assert_explained(answer):
    body = answer.json()
    assert {"error", "where", "allowed", "do"} <= set(body)
    assert body["error"]


# Who may do what ------------------------------------------------------------------------------

READING = [
    *("/metrics", "/api/status", "/api/side"),
    *("/api/tuning", "/api/presets", "/api/presets/gentle"),
]
CHANGING = [
    ("PATCH", "/api/tuning", "tuner"),
    ("POST", "/api/tuning/undo", "tuner"),
    ("POST", "/api/side", "operator"),
    ("PUT", "/api/presets/mine", "tuner"),
    ("POST", "/api/engage", "operator"),
    ("POST", "/api/park", "viewer"),
    ("POST", "/api/reset", "operator"),
]
RANK = ["viewer", "tuner", "operator"]


@pytest.mark.parametrize("path", [*READING, "/api/stream"])
@pytest.mark.parametrize("headers", [{}, {"x-forwarded-for": "127.0.0.1"}])
def test_strangers_from_elsewhere_see_nothing(world, path, headers):
    answer = world.client(peer=AWAY, **headers).get(path)
    assert answer.status_code == 401
    assert answer.headers["www-authenticate"] == "Bearer"
    assert_explained(answer)


@pytest.mark.parametrize("path", READING)
def test_a_program_on_this_computer_may_look_but_not_through_a_proxy(world, path):
    assert world.client().get(path).status_code == 200
    assert world.client(**{"x-forwarded-for": "198.51.100.1"}).get(path).status_code == 401
    assert world.client("viewer", AWAY).get(path).status_code == 200


@pytest.mark.parametrize(("method", "path", "needed"), CHANGING)
@pytest.mark.parametrize("role", [None, *RANK])
@pytest.mark.parametrize("peer", [HERE, AWAY])
def test_changes_need_the_role(world, method, path, needed, role, peer):
    answer = world.client(role, peer).request(method, path, json={}, headers={"if-match": '"1"'})
    if role is None:
        assert answer.status_code == 401
    elif RANK.index(role) < RANK.index(needed):
        assert answer.status_code == 403
    else:
        assert answer.status_code not in (401, 403)
        return
    assert_explained(answer)
    assert world.asked == []


@pytest.mark.parametrize(
    "value",
    [
        "Bearer nonsense",
        "Bearer",
        "",
        f"Basic {TOKENS['operator']}",
        f"Bearer {TOKENS['operator']}x",
        f"Bearer {TOKENS['operator'][:-1]}",
        "Bearer \xff\xfe",
    ],
)
def test_a_wrong_token_is_refused_even_where_none_is_needed(world, value):
    answer = world.client().get("/api/status", headers={"authorization": value.encode("latin-1")})
    assert answer.status_code == 401
    assert_explained(answer)


# What the gate refuses ------------------------------------------------------------------------


@pytest.mark.parametrize(
    "host", ["evil.example", "127.0.0.1.evil.example", "", "localhost:x", "a@localhost", "[::2]"]
)
@pytest.mark.parametrize("path", ["/", "/healthz", "/api/status", "/api/stream"])
def test_foreign_host_names_are_refused(world, host, path):
    answer = world.client("operator").get(path, headers={"host": host})
    assert answer.status_code == 400
    assert_explained(answer)


@pytest.mark.parametrize("host", ["127.0.0.1:8080", "localhost", "LOCALHOST:9", "[::1]:8080"])
def test_own_host_names_are_taken(world, host):
    assert world.client().get("/healthz", headers={"host": host}).status_code == 200


@pytest.mark.parametrize(
    "headers",
    [
        {"origin": "http://evil.example"},
        {"origin": "null"},
        {"origin": "http://127.0.0.1:9090"},
        {"origin": "http://127.0.0.1:8080.evil.example"},
        {"sec-fetch-site": "cross-site"},
        {"sec-fetch-site": "same-site"},
    ],
)
@pytest.mark.parametrize(
    ("method", "path"),
    [*((m, p) for m, p, _ in CHANGING), ("GET", "/api/stream"), ("GET", "/api/status")],
)
def test_requests_of_other_sites_are_refused(world, method, path, headers):
    answer = world.client("operator").request(method, path, headers=headers)
    assert answer.status_code == 403
    assert_explained(answer)
    assert world.asked == []


def test_own_page_and_links_to_it_are_taken(world):
    own = {"origin": "http://127.0.0.1:8080", "sec-fetch-site": "same-origin"}
    assert world.client("viewer").post("/api/park", headers=own).status_code == 200
    link = {"sec-fetch-site": "cross-site", "sec-fetch-mode": "navigate"}
    assert world.client().get("/", headers=link | {"sec-fetch-dest": "document"}).is_success
    assert world.client().get("/", headers=link | {"sec-fetch-dest": "iframe"}).is_client_error


@pytest.mark.parametrize("kind", ["text/plain", "application/x-www-form-urlencoded", ""])
def test_bodies_that_are_not_announced_as_json_are_refused(world, kind):
    headers = {"content-type": kind, "if-match": '"1"'}
    answer = world.client("tuner").patch("/api/tuning", content="{}", headers=headers)
    assert answer.status_code == 415
    assert_explained(answer)


def test_large_bodies_are_refused_announced_or_not(world):
    client = world.client("tuner", **{"if-match": '"1"', "content-type": "application/json"})
    assert client.patch("/api/tuning", content=b" " * 65537).status_code == 413
    answer = client.patch("/api/tuning", content=iter([b" " * 40000] * 3))
    assert answer.status_code == 413
    assert_explained(answer)
    lying = {"content-length": "1073741824"}
    assert client.patch("/api/tuning", content=b"{}", headers=lying).status_code == 413


@pytest.mark.parametrize("path", ["/", "/static/app.js", "/api/status", "/nothing"])
def test_answers_carry_the_security_headers(world, path):
    headers = world.client().get(path).headers
    assert headers["content-security-policy"].startswith("default-src 'self'")
    assert headers["x-frame-options"] == "DENY"
    assert headers["x-content-type-options"] == "nosniff"


@pytest.mark.parametrize(
    "path", ["/docs", "/redoc", "/openapi.json", "/nothing", "/static/%2e%2e/app.py"]
)
def test_nothing_else_is_served(world, path):
    answer = world.client("operator").get(path)
    assert answer.status_code == 404
    assert_explained(answer)


# Motion ---------------------------------------------------------------------------------------


def test_engage_and_park_reach_the_guard_and_are_written_down(world):
    client = world.client("operator")
    assert client.post("/api/engage").json()["state"] == "RAISING"
    again = client.post("/api/engage")
    assert again.status_code == 409
    assert again.json()["state"] == "RAISING"
    for _ in range(2):
        assert world.client("viewer").post("/api/park").json()["ok"] is True
    assert world.asked[0] == {"op": "engage", "by": "http"}
    text = world.config.audit_file.read_text()
    lines = [json.loads(line) for line in text.splitlines()]
    assert [x["action"] for x in lines] == ["engage", "engage", "park", "park"]
    assert lines[0]["role"] == "operator"
    assert len({x["previous"] for x in lines}) == 4


@pytest.mark.parametrize(
    ("more", "status"),
    [
        ({"engage": "local"}, 403),
        ({"engage": "http"}, 200),
        ({"host": "192.0.2.1", "allowed_hosts": ("127.0.0.1",)}, 403),
        ({"host": "192.0.2.1", "allowed_hosts": ("127.0.0.1",), "enable_input": True}, 200),
    ],
)
def test_engaging_by_http_follows_the_policy(tmp_path, more, status):
    world = World(tmp_path, **more)
    answer = world.client("operator").post("/api/engage")
    assert answer.status_code == status
    assert bool(world.asked) == (status == 200)


def test_a_silent_guard_is_a_503(world):
    world.silent = True
    answer = world.client("viewer").post("/api/park")
    assert answer.status_code == 503
    assert_explained(answer)


# Tuning ---------------------------------------------------------------------------------------


def patch(world, content, tag='"1"', role="tuner"):
    headers = {"content-type": "application/json"}
    if tag is not None:
        headers["if-match"] = tag
    content = content if isinstance(content, (str, bytes)) else json.dumps(content)
    return world.client(role).patch("/api/tuning", content=content, headers=headers)


def test_tuning_is_changed_with_its_version_and_undone(world):
    answer = world.client().get("/api/tuning")
    assert answer.headers["etag"] == '"1"'
    assert len(answer.json()["fields"]) == len(answer.json()["values"])
    answer = patch(world, {"scale": 0.4, "tilt_rate_deg_s": 6})
    assert (answer.status_code, answer.headers["etag"]) == (200, '"2"')
    assert answer.json()["values"]["scale"] == 0.4
    undo = world.client("tuner").post("/api/tuning/undo", headers={"if-match": '"2"'})
    assert (undo.json()["version"], undo.json()["values"]["scale"]) == (3, 0.6)


@pytest.mark.parametrize(
    ("tag", "status"),
    [(None, 428), ('"2"', 412), ("1", 412), ("*", 412), ('W/"1"', 412), ('"1", "2"', 412)],
)
def test_versions_are_compared(world, tag, status):
    answer = patch(world, {"scale": 0.1}, tag)
    assert answer.status_code == status
    assert_explained(answer)
    assert world.scene.book.model.scale == 0.6


@pytest.mark.parametrize(
    ("content", "field"),
    [
        ('{"scale": NaN}', "scale"),
        ('{"scale": Infinity}', "scale"),
        ('{"scale": 1e999}', "scale"),
        ('{"scale": "0.5"}', "scale"),
        ('{"scale": true}', "scale"),
        ('{"scale": [1]}', "scale"),
        ('{"scale": 1.01}', "scale"),
        ('{"box_surge_m": 0.199}', "box_surge_m"),
        ('{"filters": "\\ud800"}', "filters"),
        ('{"leg_speed": 1}', "leg_speed"),
        ('{"\\ud800": 1}', None),
    ],
)
def test_values_outside_are_explained_by_field(world, content, field):
    answer = patch(world, content)
    assert answer.status_code == 422
    assert_explained(answer)
    (detail,) = answer.json()["details"]
    assert set(detail) == {"field", "value", "allowed", "message"}
    assert field is None or detail["field"] == field
    assert world.asked == []
    assert world.scene.book.version == 1


@pytest.mark.parametrize("content", ["[]", "3", "null", '"x"'])
def test_json_that_is_no_object_is_a_422(world, content):
    assert patch(world, content).status_code == 422


@pytest.mark.parametrize(
    "content", ["", "{", "\x00", b"\xff", "[" * 60000, '{"scale": ' + "9" * 9000]
)
def test_what_is_no_json_is_a_400(world, content):
    answer = patch(world, content)
    assert answer.status_code == 400
    assert_explained(answer)


def test_a_value_too_long_to_repeat_is_cut(world):
    answer = patch(world, {"filters": "x" * 60000})
    assert len(answer.json()["details"][0]["value"]) <= 80


def test_too_many_changes_a_second_are_a_429(world):
    world.scene.book = TuningBook(MACHINE, lambda: 5.0)
    assert patch(world, {"scale": 0.1}).status_code == 200
    assert patch(world, {"scale": 0.2}, '"2"').status_code == 200
    answer = patch(world, {"scale": 0.3}, '"3"')
    assert answer.status_code == 429
    assert answer.headers["retry-after"] == "1"


def test_presets_are_saved_listed_and_applied(world):
    client = world.client("tuner")
    patch(world, {"scale": 0.3})
    assert client.put("/api/presets/mine").status_code == 201
    assert client.put("/api/presets/half", json={"scale": 0.5}).status_code == 201
    listed = {p["name"]: p["built_in"] for p in client.get("/api/presets").json()["presets"]}
    assert listed["mine"] is False
    assert listed["paper-2014"] is True
    assert client.get("/api/presets/mine").json()["values"]["scale"] == 0.3
    values = client.get("/api/presets/paper-2014").json()["values"]
    assert patch(world, values, '"2"').json()["values"]["halving"] == "paper"


@pytest.mark.parametrize(
    "name", ["..%2f..%2fetc%2fpasswd", "%2e%2e", "A", "a.toml", "x" * 41, "a%00"]
)
def test_preset_names_cannot_leave_the_directory(world, name):
    client = world.client("tuner")
    assert client.get(f"/api/presets/{name}").status_code in (404, 405)
    assert client.put(f"/api/presets/{name}", json={"scale": 0.5}).status_code in (404, 405, 422)
    assert not (world.config.presets_dir).exists()


@pytest.mark.parametrize(("name", "body"), [("mine", {"scale": 2.0}), ("gentle", {"scale": 0.5})])
def test_bad_presets_are_not_saved(world, name, body):
    answer = world.client("tuner").put(f"/api/presets/{name}", json=body)
    assert answer.status_code == 422
    assert answer.json()["details"]


# Status ---------------------------------------------------------------------------------------


def test_status_says_what_it_must(world):
    data = world.client().get("/api/status").json()
    assert (data["state"], data["algorithm"]) == ("PARKED", "mpc")
    assert len(data["x_max"]) == 6
    assert set(data["processes"]) == {"guard", "planner", "web", "spare", "service"}
    assert data["processes"]["spare"]["alive"] is True
    assert data["processes"]["planner"]["restarts"] == 1
    assert all({"pid", "alive"} <= set(p) for p in data["processes"].values())
    assert data["rates_hz"]["send"] == 60.0
    assert data["counters"]["plans_rejected"] == 3
    assert data["guard"]["limits"]["digest"] == MACHINE.digest


def test_dead_and_absent_processes_are_named(world):
    guard = world.scene.guard() | {"t_ns": time.monotonic_ns() - 3_000_000_000}
    world.scene.guard = lambda: guard
    app = build_app(
        world.config, Newest(lambda: guard), Newest(lambda: None), NONE, lambda _: {}, lambda _: {}
    )
    client = TestClient(app, base_url="http://127.0.0.1:8080", client=HERE)
    data = client.get("/api/status").json()
    assert data["state"] == "UNKNOWN"
    assert "guard has not reported for 3" in data["reason"]
    assert data["processes"]["planner"]["alive"] is False
    assert data["planner"] is None
    assert client.get("/metrics").status_code == 200


def test_numbers_that_are_not_finite_become_null(world):
    planner = world.scene.planner() | {"kappa": math.nan, "x_max": [math.inf] * 6}
    app = build_app(
        world.config,
        Newest(lambda: None),
        Newest(lambda: planner),
        NONE,
        lambda _: {},
        lambda _: {},
    )
    client = TestClient(app, base_url="http://127.0.0.1:8080", client=HERE)
    assert client.get("/api/status").json()["x_max"] == [None] * 6


def test_metrics_are_valid_and_tell_the_state(world):
    world.client().get("/nothing")
    text = world.client().get("/metrics").text
    families = {f.name: f for f in text_string_to_metric_families(text)}
    states = {s.labels["state"]: s.value for s in families["motionserver_state"].samples}
    assert states["PARKED"] == 1.0
    assert sum(states.values()) == 1.0
    assert families["motionserver_leg_length_metres"].samples[0].value > 0.9
    names = {s.labels["name"] for s in families["motionserver_events"].samples}
    assert {"plans_rejected", "cues"} <= names
    answered = {s.labels["status"]: s.value for s in families["motionserver_http_answers"].samples}
    assert answered["404"] == 1.0
    assert families["motionserver_audit_lost"].samples[0].value == 0.0


def test_what_the_audit_log_could_not_keep_is_counted(world, tmp_path):
    client = world.client()
    with open(world.config.audit_file.with_name("audit.jsonl.lock"), "ab") as held:
        fcntl.flock(held, fcntl.LOCK_EX)
        client.post("/api/park")
    families = {f.name: f for f in text_string_to_metric_families(client.get("/metrics").text)}
    assert families["motionserver_audit_lost"].samples[0].value == 1.0


def test_hostile_text_of_the_device_stays_text(world):
    hostile = "</script><img src=x onerror=alert(1)>\u2028\ud800"
    guard = world.scene.guard() | {"reason": hostile}
    world.scene.guard = lambda: guard
    app = build_app(
        world.config, Newest(lambda: guard), Newest(lambda: None), NONE, lambda _: {}, lambda _: {}
    )
    answer = TestClient(app, base_url="http://127.0.0.1:8080", client=HERE).get("/api/status")
    assert answer.headers["content-type"] == "application/json"
    assert answer.text.isascii()
    assert answer.json()["reason"] == hostile


# Side engines ---------------------------------------------------------------------------------


def test_side_engines_are_read_and_changed_and_written_down(world):
    answer = world.client().get("/api/side")
    assert answer.json()["engines"] == ["classical"]
    assert {"classical", "thondel2014"} <= set(answer.json()["allowed"])
    names = ["thondel2014", "classical"]
    answer = world.client("operator").post("/api/side", json={"engines": names})
    assert (answer.status_code, answer.json()["engines"]) == (200, names)
    assert world.asked[-1] == {"op": "side", "engines": names}
    noted = json.loads(world.config.audit_file.read_text().splitlines()[-1])
    assert (noted["action"], noted["result"]) == ("side", "done")
    assert (noted["old"], noted["new"]) == (["classical"], names)


@pytest.mark.parametrize(
    "body",
    [
        {},
        {"engines": "classical"},
        {"engines": ["magic"]},
        {"engines": ["classical", "classical"]},
        {"engines": [7, None, {}]},
        {"engines": [], "more": 1},
    ],
)
def test_side_engines_that_are_not_allowed_are_explained(world, body):
    answer = world.client("operator").post("/api/side", json=body)
    assert answer.status_code == 422
    assert_explained(answer)
    assert "classical" in answer.json()["allowed"] + answer.json()["do"]
    assert world.asked == []


def test_metrics_compare_the_engines(world):
    text = world.client().get("/metrics").text
    values = {
        sample.labels["engine"]: sample.value
        for family in text_string_to_metric_families(text)
        for sample in family.samples
        if sample.name == "motionserver_engine_nrmse"
    }
    assert values == {"mpc": 0.31, "classical": 0.594}
