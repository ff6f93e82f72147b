"""A line in virtual time: nothing gets lost beside the counters, and room is bounded."""

from dataclasses import asdict

import pytest
from hypothesis import given
from hypothesis import strategies as st
from motion_clients.delay_line import MOST_BYTES, MOST_HELD, DelayLine
from motion_clients.flawed_link import LinkFlaws

shares = st.floats(0.0, 1.0)
any_flaws = st.builds(
    LinkFlaws,
    loss=shares,
    duplicate=shares,
    reorder=shares,
    corrupt=shares,
    truncate=shares,
    delay=st.floats(0, 0.1),
    jitter=st.floats(0, 0.1),
)
traffic = st.lists(st.tuples(st.floats(0.0, 0.05), st.binary(max_size=9)), min_size=10, max_size=30)


def played(flaws, seed, steps):
    """Instants and bytes of all that comes out, looked at whenever something goes in."""
    line, out, now = DelayLine(flaws, seed=seed), [], 0.0
    for pause, datagram in steps:
        now += pause
        line.put(now, datagram)
        out += [(now, arrived) for arrived in line.take(now)]
    return line, out


@given(flaws=any_flaws, seed=st.integers(0, 99), steps=traffic)
def test_the_same_packets_at_the_same_instants_leave_alike(flaws, seed, steps):
    one, two = played(flaws, seed, steps), played(flaws, seed, steps)
    assert one[1] == two[1]
    assert asdict(one[0].counts) == asdict(two[0].counts)
    assert one[0].next_due == two[0].next_due


@given(flaws=any_flaws, seed=st.integers(0, 99), steps=traffic)
def test_every_packet_is_accounted_for(flaws, seed, steps):
    line, out = played(flaws, seed, steps)
    counts = line.counts
    assert counts.received == len(steps)
    assert counts.received + counts.duplicated == counts.lost + len(out) + len(line)
    assert len(out) + len(line) <= len(steps) + counts.duplicated
    rest = line.take(1e9)
    assert len(line) == 0
    assert line.next_due is None
    assert len(out) + len(rest) == counts.received + counts.duplicated - counts.lost


@given(pauses=st.lists(st.floats(0.0, 0.1), min_size=10, max_size=30), delay=st.floats(0.001, 0.3))
def test_a_delay_is_kept_to_and_keeps_the_order(pauses, delay):
    line, sent, now = DelayLine(LinkFlaws(delay=delay)), [], 0.0
    for k, pause in enumerate(pauses):
        now += pause
        sent.append((now + delay, bytes([k])))
        line.put(now, bytes([k]))
    while (due := line.next_due) is not None:
        assert line.take(due - 1e-9) == []
        arrived = line.take(due)
        assert [(due, datagram) for datagram in arrived] == sent[: len(arrived)]
        del sent[: len(arrived)]
    assert sent == []


@pytest.mark.parametrize(("size", "room"), [(0, MOST_HELD), (65507, MOST_BYTES // 65507)])
def test_a_flood_is_dropped_and_counted_the_older_packets_stay(size, room):
    line = DelayLine(LinkFlaws(delay=1.0))
    for k in range(2 * room):
        line.put(0.0, bytes([k % 251]) * size)
    assert len(line) == room
    assert line.counts.dropped == room
    assert line.take(1.0) == [bytes([k % 251]) * size for k in range(room)]
    # what left makes room again, for just as many
    for _ in range(room):
        line.put(2.0, bytes(size))
    assert line.counts.dropped == room
    line.put(2.0, bytes(size))
    assert line.counts.dropped == room + 1
    assert line.take(3.0) == [bytes(size)] * room
