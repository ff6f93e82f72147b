import socket

import pytest
from motion_clients.force_sender import ForceSender
from motion_protocol import Flags, Reference, decode_cue


def test_readings_arrive_as_measured_specific_force():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
        receiver.bind(("127.0.0.1", 0))
        receiver.settimeout(5.0)
        sender = ForceSender(receiver.getsockname(), key=b"secret", session=5)
        sender(12.5, (0.1, -0.2, 9.81), (0.01, 0.0, -0.01))
        sender(12.51, (0.1, -0.2, 9.81), (0.01, 0.0, -0.01))
        one, two = (decode_cue(receiver.recv(2048), b"secret") for _ in range(2))
        sender.close()
    assert one.flags == Flags.GRAVITY_INCLUDED | Flags.MEASURED_AT_PLATFORM
    assert one.motion.reference is Reference.PLATFORM
    assert one.motion.acceleration == pytest.approx((0.1, -0.2, 9.81), abs=1e-6)
    assert one.motion.rates == pytest.approx((0.01, 0.0, -0.01), abs=1e-6)
    assert one.sim_time_ns == 12_500_000_000
    assert one.session == two.session == 5
    assert (one.sequence, two.sequence) == (0, 1)
    assert sender.sent == 2


def test_missing_receiver_does_not_stop_the_sensor():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
        receiver.bind(("127.0.0.1", 0))
        address = receiver.getsockname()
    sender = ForceSender(address)
    for _ in range(5):
        sender(1.0, (0.0, 0.0, 9.81), (0.0, 0.0, 0.0))
    sender.close()
    assert sender.sent + sender.refused == 5
    assert sender.refused > 0
