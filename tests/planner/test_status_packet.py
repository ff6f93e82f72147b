"""What the owner is told: its own times, numbers and counts, and the state."""

from collections import Counter

import pytest
from motion_protocol import Cue, Motion, PlatformState, decode_status, encode_cue, encode_status

from motionserver.core.intake.gate import Gate
from motionserver.core.safety.states import State
from motionserver.planner.reply import status_packet
from motionserver.sources.native import NativeSource


def test_the_owner_hears_its_own_times_and_what_became_of_its_packets():
    still = Motion((0.0, 0.0, 9.81), (0.0, 0.0, 0.0))
    cue = Cue(session=9, sequence=41, sim_time_ns=12_345, sender_time_ns=777, motion=still)
    motion = NativeSource().decode(encode_cue(cue), 1_000_000_000)
    gate = Gate()
    assert gate.refuse("native", "a", motion) is None
    counted = Counter(status_sent=7, refused=3, refused_reordered=2)
    told = decode_status(encode_status(status_packet(gate, counted, motion, State.RUN, 0.6)))
    assert (told.session, told.sequence) == (9, 7)
    assert told.sim_time_ns == 12_345
    assert told.echo_sender_time_ns == 777
    assert told.receive_time_ns == 1_000_000_000
    assert (told.echo_sequence, told.accepted_sequence) == (41, 41)
    assert (told.lost, told.reordered, told.rejected) == (0, 2, 3)
    assert told.scale == pytest.approx(0.6)
    assert told.state is PlatformState.RUN
