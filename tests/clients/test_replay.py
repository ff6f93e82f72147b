"""Replay over real loopback sockets on a manual clock: pace, skips, rounds, formats."""

import math
import socket
import struct
import threading

import pytest
from motion_clients import read_recording, recording_path, replay
from motion_clients.beamng import MotionSimEncoder
from motion_clients.recording import RecordedSample
from motion_clients.replay import preview_of
from motion_protocol import Flags, Mode, decode_cue

HEADER = "t,ax,ay,az,p,q,r,v,roll,pitch\n"


class ManualClock:
    """A clock that only moves when somebody sleeps; it remembers how long."""

    def __init__(self):
        self.now = 10**9
        self.naps = []
        self.overslept = 0.0

    def __call__(self):
        return self.now

    def sleep(self, duration):
        self.naps.append(duration)
        self.now += round((duration + self.overslept) * 1e9)


@pytest.fixture
def listener():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as udp:
        udp.bind(("127.0.0.1", 0))
        udp.settimeout(5.0)
        yield udp


@pytest.fixture
def drive(tmp_path):
    path = tmp_path / "drive.csv"
    rows = [f"{5 + k / 100},{k},0.5,-0.5,0.25,0.125,-0.25,{k},0.0,0.0\n" for k in range(20)]
    path.write_text(HEADER + "".join(rows))
    return path


def run(drive, listener, clock, **options):
    return replay(
        drive, "127.0.0.1", listener.getsockname()[1], clock_ns=clock, sleep=clock.sleep, **options
    )


def received(listener, count):
    return [listener.recv(2000) for _ in range(count)]


def test_native_replay_sends_every_sample_on_its_grid_then_bye(drive, listener):
    clock = ManualClock()
    counts = run(drive, listener, clock)
    assert (counts.sent, counts.unsent, counts.skipped, counts.rounds) == (20, 0, 0, 1)
    cues = [decode_cue(data) for data in received(listener, 21)]
    assert [c.motion.acceleration[0] for c in cues[:20]] == list(range(20))
    assert [c.motion.speed for c in cues[:20]] == list(range(20))
    assert [c.sim_time_ns for c in cues[:20]] == [k * 10_000_000 for k in range(20)]
    assert [c.sender_time_ns for c in cues[:20]] == pytest.approx(
        [10**9 + k * 10_000_000 for k in range(20)], abs=2
    )
    assert {c.flags for c in cues[:20]} == {Flags.REPLAY}
    assert {c.mode for c in cues[:20]} == {Mode.DRIVE}
    assert {c.motion.rates for c in cues[:20]} == {(0.25, 0.125, -0.25)}
    assert cues[20].mode is Mode.BYE


def test_speed_changes_the_pace_only(drive, listener):
    clock = ManualClock()
    run(drive, listener, clock, speed=2.0)
    assert clock.now - 10**9 == pytest.approx(0.19e9 / 2, abs=100)
    cues = [decode_cue(data) for data in received(listener, 20)]
    assert [c.sim_time_ns for c in cues] == [k * 10_000_000 for k in range(20)]


def test_late_sleeps_skip_samples_and_do_not_drift(drive, listener):
    clock = ManualClock()
    clock.overslept = 0.025
    counts = run(drive, listener, clock)
    assert counts.sent + counts.skipped == 20
    assert counts.skipped > 5
    cues = [decode_cue(data) for data in received(listener, counts.sent + 1)]
    assert cues[-2].motion.acceleration[0] == 19.0
    for cue in cues[:-1]:
        assert -1 <= cue.sender_time_ns - 10**9 - cue.sim_time_ns < 26_000_000
    assert [c.sequence for c in cues] == list(range(counts.sent + 1))


def test_loop_marks_each_new_round_as_teleport_until_stopped(drive, listener):
    clock = ManualClock()
    counts = run(drive, listener, clock, loop=True, stop=lambda: clock.now >= 10**9 + 450_000_000)
    assert counts.rounds == 2
    cues = [decode_cue(data) for data in received(listener, counts.sent + 1)]
    assert [i for i, c in enumerate(cues) if c.mode is Mode.TELEPORT] == [20, 40]
    times = [c.sim_time_ns for c in cues[:-1]]
    assert times == sorted(set(times))
    assert cues[-1].mode is Mode.BYE


def test_event_stops_at_once(drive, listener):
    stop = threading.Event()
    stop.set()
    counts = run(drive, listener, ManualClock(), stop=stop)
    assert counts.sent == 0
    assert decode_cue(listener.recv(2000)).mode is Mode.BYE


def test_key_and_preview_are_sent(listener):
    clock = ManualClock()
    key = b"k" * 32
    path = recording_path("truck_brake_accel")
    run(path, listener, clock, key=key, preview=2.0, stop=lambda: clock.now > 10**9)
    cue = decode_cue(listener.recv(2000), key)
    assert len(cue.preview.samples) == 40
    # every 10 ms for 0.2 s, then 1.8 s in 20 steps
    assert cue.preview.times[:20] == pytest.approx([0.01 * k for k in range(1, 21)])
    assert cue.preview.times[20:] == pytest.approx([0.2 + 0.09 * k for k in range(1, 21)])


def test_preview_holds_what_the_recording_does_next(drive):
    recording = read_recording(drive)
    preview = preview_of(recording, recording.samples[2], 0.2)
    assert preview.times == pytest.approx([0.01 * k for k in range(1, 18)])
    # ax grows by 1 with every sample
    assert [sample[0] for sample in preview.samples] == pytest.approx(list(range(3, 20)))
    assert preview_of(recording, recording.samples[-1], 1.0) is None
    assert preview_of(recording, recording.samples[0], 0.0) is None


def test_beamng_replay_inverts_the_axis_map(drive, listener):
    clock = ManualClock()
    counts = run(drive, listener, clock, fmt="beamng")
    assert counts.sent == 20
    packets = [struct.unpack("<4s21f", data) for data in received(listener, 20)]
    for k, packet in enumerate(packets):
        assert packet[0] == b"BNG1"
        acc_x, acc_y, acc_z = packet[7:10]
        assert (acc_y, -acc_x, acc_z) == (k, 0.5, -0.5)
        assert packet[16:19] == (0.25, -0.125, 0.25)


def test_beamng_packet_by_hand():
    sample = RecordedSample(0.0, (1.0, 2.0, 3.0), (0.5, 0.25, 0.125), 4.0, (0.0, 0.0))
    packet = MotionSimEncoder().encode(sample)
    words = packet.hex(" ", 4).replace("00000080", "00000000")  # minus zero is zero
    assert words == (
        "424e4731 00000000 00000000 00000000"  # BNG1, position 0 0 0
        " 00000000 00008040 00000000"  # velocity: 4 m/s towards +Y, forward at heading zero
        " 000000c0 0000803f 00004040"  # acceleration: right -2, forward 1, up 3
        " 00000000 00000000 0000803f"  # up
        " 00000000 00000000 00000000"  # roll, pitch, yaw
        " 0000003f 000080be 000000be"  # rates: p, -q, -r
        " 00000000 00000000 00000000"  # angular accelerations of a first sample
    )


def test_beamng_dead_reckoning_turns_left_and_starts_anew():
    encoder = MotionSimEncoder()
    samples = [
        RecordedSample(k / 100, (0.0,) * 3, (0.0, 0.0, math.pi / 2), 10.0, (0.0, 0.0))
        for k in range(101)
    ]
    last = [struct.unpack("<4s21f", encoder.encode(sample)) for sample in samples][-1]
    assert last[4:7] == pytest.approx((-10.0, 0.0, 0.0), abs=1e-4)  # to the left: -X
    assert last[15] == pytest.approx(-math.pi / 2, abs=1e-5)
    again = struct.unpack("<4s21f", encoder.encode(samples[0]))
    assert again[1:4] == (0.0, 0.0, 0.0)
    steep = RecordedSample(0.01, (0.0,) * 3, (0.0, 0.0, 9.0), 10.0, (0.0, math.pi / 2))
    assert struct.unpack("<4s21f", encoder.encode(steep))[15] == 0.0


def test_nobody_listening_does_not_stop_the_replay(drive):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as unused:
        unused.bind(("127.0.0.1", 0))
        port = unused.getsockname()[1]
    for fmt in ("native", "beamng"):
        clock = ManualClock()
        counts = replay(drive, port=port, fmt=fmt, clock_ns=clock, sleep=clock.sleep)
        assert counts.sent + counts.unsent == 20


@pytest.mark.parametrize(
    "options",
    [
        {"fmt": "csv"},
        {"speed": 0.0},
        {"speed": math.nan},
        {"preview": 3.0},
        {"port": 0},
        {"fmt": "beamng", "key": b"k"},
        {"fmt": "beamng", "preview": 1.0},
    ],
)
def test_argument_out_of_range_is_refused(drive, options):
    with pytest.raises(ValueError, match=r"allowed|choose|leave"):
        replay(drive, **options)


def test_what_the_server_recorded_is_sent_on_as_it_was_told(tmp_path):
    header = (
        "time_s,state,t,ax,ay,az,p,q,r,v,roll,pitch,mode,throttle,brake,clutch,steering,gear,"
        "sender_time_s,sim_time_s,preview\n"
    )
    rows = [
        "0.0,RUN" + "," * 19,
        ",,0.00,1,2,3,0.1,0.2,0.3,5,0.01,0.02,drive,0.5,0.25,0,-1.5,3,7.5,7.4,"
        "0.1 1 2 3 0.1 0.2 0.3 / 0.3 4 5 6 0.4 0.5 0.6",
        ",,0.01,1,2,3,0.1,0.2,0.3,5,0.01,0.02,pause,,,,,,7.51,7.41,",
        ",,0.02,1,2,3,0.1,0.2,0.3,5,0.01,0.02,teleport,,,,,,7.52,7.42,",
        ",,0.03,1,2,3,0.1,0.2,0.3,5,0.01,0.02,bye,,,,,,7.53,7.43,",
        "0.05,RUN" + "," * 19,
    ]
    path = tmp_path / "drive.csv"
    path.write_text(header + "\n".join(rows) + "\n")
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as server:
        server.bind(("127.0.0.1", 0))
        server.settimeout(10.0)
        replay(path, "127.0.0.1", server.getsockname()[1])
        cues = [decode_cue(server.recv(2048)) for _ in range(5)]
    assert [cue.mode.name for cue in cues] == ["DRIVE", "PAUSE", "TELEPORT", "PAUSE", "BYE"]
    first = cues[0]
    assert first.motion.acceleration == pytest.approx((1.0, 2.0, 3.0))
    assert first.motion.attitude == pytest.approx((0.01, 0.02))
    told = first.driver
    assert (told.throttle, told.brake, told.steering, told.gear) == (0.5, 0.25, -1.5, 3)
    assert first.preview.times == pytest.approx((0.1, 0.3))
    assert first.preview.samples[1] == pytest.approx((4, 5, 6, 0.4, 0.5, 0.6))
    assert cues[1].preview is None
    assert cues[1].driver is None
