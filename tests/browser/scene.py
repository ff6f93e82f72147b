"""A drive as guard and planner would tell it, over the real mapped files and request sockets."""

import json
import math
import os
import sys
import threading
import time
import tomllib
from importlib.resources import files
from pathlib import Path

import numpy as np

from motionserver.core.axes import frozen
from motionserver.core.kinematics.hexapod import leg_speeds
from motionserver.core.kinematics.rotation import felt
from motionserver.core.limits import Machine, Pace, machine_to_mapping
from motionserver.settings.fields import algorithms
from motionserver.settings.tuning_book import TuningBook
from motionserver.telemetry.mapped import MappedFile
from motionserver.telemetry.requests import RequestServer
from motionserver.web import wiring

CAPACITY = 32768


def t2_compact():
    data = tomllib.loads(
        files("motionserver.presets").joinpath("platforms/t2-compact.toml").read_text()
    )
    legs, table, space = data["legs"], data["table2"], data["workspace"]
    angles = [math.radians(table[f"{name}_deg"]) for name in ("roll", "pitch", "yaw")]
    return Machine(
        data["name"],
        frozen(data["base_joints"]),
        frozen(data["platform_joints"]),
        data["neutral_height"],
        legs["min"],
        legs["max"],
        legs["speed"],
        legs["acceleration"],
        legs["jerk"],
        math.radians(space["joint_angle_deg"]),
        space["conditioning"],
        None,
        frozen(data["head"]),
        frozen([0, 0, space["parked"]["heave"], 0, 0, 0]),
        frozen([table["surge"], table["sway"], table["heave"], *angles]),
        Pace(**data["pace"]),
    )


class Scene:
    """Guard and planner of a drive that repeats every minute or so."""

    def __init__(self, machine):
        self.machine = machine
        self.book = TuningBook(machine, time.monotonic)
        self.beside = ["classical"]
        self.state, self.reason = "PARKED", "parked; engage to raise"
        self.since = time.monotonic()
        self.started = self.since
        self.dead = set()
        self.stuck, self.is_ramping, self.fallback = {}, False, ""
        self.events = []
        self.tick = 0

    def put(self, state, reason):
        self.state, self.reason, self.since = state, reason, time.monotonic()
        self.events.append({"t_ns": time.monotonic_ns(), "text": f"{state}: {reason}"})

    def answer_guard(self, request):
        op = request["op"]
        if op == "engage" and self.state == "PARKED":
            self.put("RAISING", "engaged by http")
        elif op == "park" and self.state not in ("PARKED", "PARKING"):
            self.put("PARKING", "park asked by http")
        elif op == "reset" and self.state == "FAULT":
            self.put("PARKING", "reset by http")
        elif op != "park":
            reason = f"{op} is not possible in {self.state}"
            return {"ok": False, "state": self.state, "reason": reason}
        return {"ok": True, "state": self.state, "reason": self.reason}

    def told(self):
        """What the planner reads back from its engine."""
        in_force = self.book.model.values() | self.stuck
        return {"in_force": in_force, "is_ramping": self.is_ramping, "retune_error": "",
                "fallback": self.fallback}  # fmt: skip

    def answer_planner(self, request):
        if request["op"] != "side":
            answer = self.book.answer(request)
            return answer | (self.told() if answer["ok"] else {})
        self.beside = request.get("engines", self.beside)
        return {"ok": True, "engines": self.beside, "allowed": list(algorithms())}

    def side(self, force):
        def engine(name, felt, nrmse, think, part):
            return {"name": name, "felt_force": felt.tolist(), "rest_pose": [0.0] * 6,
                    "periods_judged": 1800, "rmse": 0.4 * nrmse, "nrmse": nrmse, "kappa": 1.0,
                    "kappa_whole": 1 - part, "kappa_part": 0.8 * part,
                    "kappa_refused": 0.2 * part, "no_candidate": 0.0, "think_p50_ms": think,
                    "think_p99_ms": 1.6 * think, "leg_use": 0.7, "trouble": "", "periods": 9000,
                    "skipped": 0, "raised": 0}  # fmt: skip

        made = {"thondel2014": (1.0, 0.412, 2.7, 0.012), "classical": (0.72, 0.594, 1.4, 0.083)}
        drives = self.book.model.algorithm
        shown = {n: engine(n, force * k, *rest) for n, (k, *rest) in made.items()}
        for name in algorithms():
            shown.setdefault(name, engine(name, 1.1 * force, 0.31, 4.6, 0.001))
        beside = [shown[name] for name in self.beside if name != drives]
        return {"wanted": self.beside, "driving": shown[drives], "engines": beside, "switches": 0}

    def advance(self):
        age = time.monotonic() - self.since
        if self.state == "RAISING" and age > 2.0:
            self.put("READY", "at neutral")
        elif self.state == "READY" and age > 0.5:
            self.put("RUN", "source 10.0.0.12:40312 is fresh")
        elif self.state == "PARKING" and age > 2.0:
            self.put("PARKED", "parked; engage to raise")

    def share(self):
        """How far up the platform is, 0 parked .. 1 neutral."""
        s = min((time.monotonic() - self.since) / 2.0, 1.0)
        s = s * s * (3 - 2 * s)
        return {"RAISING": s, "PARKING": 1 - s, "PARKED": 0.0, "OFFLINE": 0.0}.get(self.state, 1.0)

    def wanted(self, t):
        gain = self.book.model.scale if self.state == "RUN" else 0.0
        x = 2.6 * math.sin(0.42 * t) * math.sin(0.17 * t) ** 2
        x -= 0.8 * math.exp(4 * (math.sin(0.9 * t) - 1))
        y = 2.1 * math.sin(0.31 * t + 1) + 0.5 * math.sin(1.9 * t) * math.cos(0.13 * t)
        z = 0.5 * math.sin(5.1 * t) * math.sin(0.7 * t) ** 2 + 0.25 * math.sin(11 * t)
        return gain * np.array([x, y, z])

    def pose(self, t):
        f = self.wanted(t - 0.12) * [1, 1, 0.35]
        slow = self.wanted(t - 0.7)
        up = self.share()
        pose = np.array([
            0.030 * f[0] - 0.02 * slow[0], 0.034 * f[1] - 0.02 * slow[1], 0.05 * f[2],
            0.070 * slow[1], -0.072 * slow[0], 0.06 * math.sin(0.3 * t) * (self.state == "RUN"),
        ])  # fmt: skip
        return pose + (1.0 - up) * self.machine.parked_pose

    def motion(self, t):
        h = 0.01
        a, b, c = self.pose(t - h), self.pose(t), self.pose(t + h)
        return b, (c - a) / (2 * h), (c - 2 * b + a) / h**2

    def guard(self):
        t = time.monotonic() - self.started
        q, v, a = self.motion(t)
        legs, speed = (row[0] for row in leg_speeds(self.machine, q[None], v[None]))
        m = self.machine
        return {
            "pid": os.getpid(),
            "t_ns": time.monotonic_ns(),
            "state": self.state,
            "reason": self.reason,
            "since_ns": int(self.since * 1e9),
            "plan": {"id": 8800 + self.tick, "time": 0.01 * (self.tick % 3), "duration": 2.0,
                     "kappa": 1.0},
            "pose": q.tolist(), "velocity": v.tolist(), "acceleration": a.tolist(),
            "legs": legs.tolist(), "leg_speed": speed.tolist(),
            "feedback": {"age_s": 0.004 + 0.008 * (self.tick % 2),
                         "legs": (legs - 0.004 * speed).tolist(),
                         "device_state": "ENGAGED" if self.state == "RUN" else "PARKED",
                         "faults": []},
            "tracking_error": float(abs(0.004 * speed).max()),
            "limits": {"digest": m.digest, "leg_min": m.leg_min, "leg_max": m.leg_max,
                       "leg_speed": m.leg_speed, "leg_acceleration": m.leg_acceleration,
                       "leg_jerk": m.leg_jerk, "unchecked": ["passenger acceleration"]},
            "counters": {"plans_accepted": 100 * self.tick, "plans_rejected": 3, "late": 2,
                         "packets_out": 60 * self.tick, "feedback_bad": 0},
            "rates_hz": {"tick": 240.0, "send": 60.0, "planner": 100.0},
            "tick": {"late_p50_ms": 0.06, "late_p99_ms": 0.41, "late_max_ms": 2.3, "missed": 0},
            "rejections": [
                {"t_ns": int((self.started + 4) * 1e9), "reason": "leg-speed", "when": 0.312,
                 "leg": 3, "value": 0.613, "allowed": 0.6},
                {"t_ns": int((self.started + 2) * 1e9), "reason": "leg-length", "when": 1.104,
                 "leg": 5, "value": 1.1817, "allowed": 1.1811},
            ],
            "events": self.events[-12:],
        }  # fmt: skip

    def planner(self):
        t = time.monotonic() - self.started
        q, v, a = self.motion(t)
        force, _ = felt(q, v, a, self.machine.head)
        force = force - np.array([0, 0, 9.81])
        wanted = self.wanted(t)
        rng = np.random.default_rng(self.tick)
        near = np.abs(q) / self.machine.box
        swing = 0.5 + 0.5 * np.sin(0.23 * t + np.arange(6))
        x_max = self.machine.box * (1 - 0.5 * swing**4 - 0.1 * near)
        six = self.book.model.algorithm == "mpc"
        shares = {"leg length": 1.0 if abs(wanted[1]) > 0.9 else 0.81, "leg speed": 0.42,
                  "leg acceleration": 0.17, "leg jerk": 0.09, "tilt rate": 0.88,
                  "roll": 0.33, "pitch": 0.2, "yaw": 0.21, "conditioning": 0.0}  # fmt: skip
        measured = (force + rng.normal(0, 0.06, 3)).tolist()
        return {
            "pid": os.getpid() + 1,
            "t_ns": time.monotonic_ns(),
            "algorithm": self.book.model.algorithm,
            "x_max": [None] * 3 + x_max.tolist()[3:] if six else x_max.tolist(),
            "limit_shares": shares if six else {},
            "wanted_force": wanted.tolist(),
            "felt_force": force.tolist(),
            "measured_force": measured,
            "wanted_rates": [0.0, 0.0, 0.02],
            "source": {"kind": "udp", "address": "10.0.0.12:40312", "age_s": 0.006,
                       "rate_hz": 99.8, "mode": "DRIVE", "fresh": True, "session": 71},
            "reference": "ar",
            "solver": {"backend": self.book.model.backend, "time_p50_ms": 1.3,
                       "time_p99_ms": 2.4, "last_ms": 1.2, "iterations": 27, "status": "solved"},
            "handover": {"lead_slots": 1, "ahead_ms": 9.4, "waiting": 2,
                         "last_refusal": "too-late", "periods_waited": 0},
            "kappa": 1.0,
            "counters": {"cues": 100 * self.tick, "spikes": 1, "stale": 0, "plans_halved": 41,
                         "plans_refused": 3},
            "tuning": {"version": self.book.version, "values": self.book.model.values(),
                       **self.told()},
            "disturbance": [0.0, 0.0, 0.0],
            "rates_hz": {"planner": 100.0},
            "tracking": {"mismatch": 0.061, "alarm": False}, "trouble": "",
            "side": self.side(force),
        }  # fmt: skip

    def service(self):
        return {
            "pid": os.getpid() + 2,
            "t_ns": time.monotonic_ns(),
            "guard": os.getpid(),
            "spare": os.getpid() + 3,
            "planner": os.getpid() + 1,
            "web": None,
            "restarts": {"guard": 0, "planner": 1, "web": 0},
        }


class Peers:
    """Runs a scene over a run directory until stopped."""

    def __init__(self, run_dir, scene):
        self.scene = scene
        self._guard = MappedFile(run_dir / wiring.GUARD_SNAPSHOT, CAPACITY)
        self._planner = MappedFile(run_dir / wiring.PLANNER_SNAPSHOT, CAPACITY)
        self._service = MappedFile(run_dir / wiring.SERVICE_SNAPSHOT, CAPACITY)
        self._guard_requests = RequestServer(run_dir / wiring.GUARD_REQUESTS)
        self._planner_requests = RequestServer(run_dir / wiring.PLANNER_REQUESTS)
        self._end = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def __enter__(self):
        self._thread.start()
        return self

    def __exit__(self, *_):
        self._end.set()
        self._thread.join()
        self._guard_requests.close()
        self._planner_requests.close()
        for item in (self._guard, self._planner, self._service):
            item.close()

    def _run(self):
        scene = self.scene
        while not self._end.wait(0.02):
            scene.tick += 1
            scene.advance()
            self._service.write(json.dumps(scene.service()).encode())
            if "guard" not in scene.dead:
                for request, address in self._guard_requests.poll():
                    self._guard_requests.answer(address, scene.answer_guard(request))
                self._guard.write(json.dumps(scene.guard()).encode())
            if "planner" not in scene.dead:
                for request, address in self._planner_requests.poll():
                    self._planner_requests.answer(address, scene.answer_planner(request))
                self._planner.write(json.dumps(scene.planner()).encode())


TOKENS = {name: f"{name}-" + "0123456789abcdef" * 3 for name in ("viewer", "tuner", "operator")}


def write_configuration(folder, port, machine, **more):
    tokens = folder / "tokens.json"
    tokens.write_text(json.dumps(TOKENS))
    tokens.chmod(0o600)
    config = {
        "host": "127.0.0.1", "port": port, "tokens_file": str(tokens), "run_dir": str(folder),
        "audit_file": str(folder / "audit.jsonl"),
        "presets_dir": str(folder / "presets"), "machine": machine_to_mapping(machine),
        "engage": "http", **more,
    }  # fmt: skip
    path = folder / "web.json"
    path.write_text(json.dumps(config))
    return path


if __name__ == "__main__":
    directory = Path(sys.argv[1])
    directory.mkdir(parents=True, exist_ok=True)
    hexapod = t2_compact()
    write_configuration(directory, int(sys.argv[2]), hexapod)
    with Peers(directory, Scene(hexapod)):
        threading.Event().wait()
