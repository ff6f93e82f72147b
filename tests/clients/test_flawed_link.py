from itertools import pairwise
from math import inf, nan, sqrt

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from motion_clients.flawed_link import MOST_FLIPPED, Arrival, FlawedLink, LinkFlaws

SHARES = ("loss", "duplicate", "reorder", "corrupt", "truncate")
shares = st.floats(0.0, 1.0)
seeds = st.integers(0, 2**32)
any_flaws = st.builds(
    LinkFlaws,
    **dict.fromkeys(SHARES, shares),
    delay=st.floats(0, 1),
    jitter=st.floats(0, 1),
    reorder_delay=st.floats(0, 1),
    silences=st.lists(
        st.tuples(st.floats(0, 5), st.floats(0.01, 5)).map(lambda s: (s[0], s[0] + s[1])),
        max_size=3,
    ).map(tuple),
)
datagrams = st.integers(0, 60).map(lambda count: [bytes([k]) * (k % 11) for k in range(count)])


def named(k):
    return k.to_bytes(8, "big")


def arrivals(flaws, seed=0, count=2000):
    link = FlawedLink(flaws, seed=seed)
    sent = [(k * 0.01, link.carry(k * 0.01, named(k))) for k in range(count)]
    order = sorted((at + a.delay, k) for k, (at, copies) in enumerate(sent) for a in copies)
    return link, [k for _, k in order]


def fates(flaws, seed, sent):
    link = FlawedLink(flaws, seed=seed)
    return [link.carry(k * 0.1, datagram) for k, datagram in enumerate(sent)]


def flipped_bits(a, b):
    return (int.from_bytes(a, "big") ^ int.from_bytes(b, "big")).bit_count()


def test_sound_link_delivers_all_once_at_once():
    link, order = arrivals(LinkFlaws())
    assert order == list(range(2000))
    assert link.lost == 0
    assert FlawedLink().carry(3.0, b"as it is") == (Arrival(0.0, b"as it is"),)


@settings(max_examples=50)
@given(name=st.sampled_from(SHARES), share=shares, seed=seeds)
def test_every_flaw_has_its_rate_and_no_other_happens(name, share, seed):
    count = 1000
    link, order = arrivals(LinkFlaws(**{name: share}), seed, count)
    counts = link.counts
    happened = {
        "loss": counts.lost,
        "duplicate": counts.duplicated,
        "reorder": counts.reordered,
        "corrupt": counts.corrupted,
        "truncate": counts.truncated,
    }
    # five and a half standard deviations
    assert abs(happened[name] - count * share) <= 5.5 * sqrt(count * share * (1 - share)) + 1e-9
    assert sum(happened.values()) == happened[name]
    assert counts.received == count
    assert len(order) == count - counts.lost + counts.duplicated
    assert counts.changed == counts.corrupted + counts.truncated


def test_overtaking_happens():
    link, order = arrivals(LinkFlaws(reorder=0.1))
    overtaken = sum(a > b for a, b in pairwise(order))
    # held back by two and a half intervals: some are held back side by side
    assert 0.5 * link.counts.reordered < overtaken <= link.counts.reordered
    assert sorted(order) == list(range(2000))


@given(flaws=any_flaws, seed=seeds, sent=datagrams)
def test_the_same_packets_at_the_same_instants_meet_the_same_fates(flaws, seed, sent):
    assert fates(flaws, seed, sent) == fates(flaws, seed, sent)


def test_another_seed_is_another_fate():
    flaws, sent = LinkFlaws(loss=0.5), [bytes(8)] * 64
    assert len({tuple(fates(flaws, seed, sent)) for seed in range(20)}) == 20


@given(flaws=any_flaws, seed=seeds, sent=datagrams)
def test_nothing_arrives_more_than_twice_nor_out_of_nothing(flaws, seed, sent):
    for k, (datagram, copies) in enumerate(zip(sent, fates(flaws, seed, sent), strict=True)):
        assert len(copies) <= (2 if flaws.duplicate else 1)
        assert not (copies and flaws.is_silent(k * 0.1))
        for copy in copies:
            least = flaws.delay
            assert least <= copy.delay <= least + flaws.jitter + flaws.reorder_delay
            assert len(copy.datagram) <= len(datagram)
            if not (flaws.corrupt or flaws.truncate):
                assert copy.datagram == datagram


@given(seed=seeds, datagram=st.binary(min_size=1, max_size=1500))
def test_corruption_flips_a_few_bits_and_keeps_the_length(seed, datagram):
    (arrival,) = FlawedLink(LinkFlaws(corrupt=1.0), seed=seed).carry(0.0, datagram)
    assert len(arrival.datagram) == len(datagram)
    assert 1 <= flipped_bits(arrival.datagram, datagram) <= MOST_FLIPPED


@given(seed=seeds, datagram=st.binary(min_size=1, max_size=1500))
def test_truncation_keeps_a_beginning(seed, datagram):
    (arrival,) = FlawedLink(LinkFlaws(truncate=1.0), seed=seed).carry(0.0, datagram)
    assert len(arrival.datagram) < len(datagram)
    assert datagram.startswith(arrival.datagram)


def test_damage_is_spread_over_number_place_and_length():
    link = FlawedLink(LinkFlaws(corrupt=1.0), seed=1)
    damaged = [link.carry(0.0, bytes(4))[0].datagram for _ in range(2000)]
    assert {flipped_bits(d, bytes(4)) for d in damaged} == set(range(1, MOST_FLIPPED + 1))
    touched = 0
    for datagram in damaged:
        touched |= int.from_bytes(datagram, "big")
    assert touched == 2**32 - 1
    link = FlawedLink(LinkFlaws(truncate=1.0), seed=1)
    assert {len(link.carry(0.0, bytes(4))[0].datagram) for _ in range(200)} == {0, 1, 2, 3}


def test_what_is_empty_cannot_be_damaged():
    link = FlawedLink(LinkFlaws(corrupt=1.0, truncate=1.0))
    assert link.carry(0.0, b"") == (Arrival(0.0, b""),)
    assert (link.counts.corrupted, link.counts.truncated, link.counts.changed) == (0, 0, 0)


def test_both_kinds_of_damage_are_one_change():
    link, _ = arrivals(LinkFlaws(corrupt=1.0, truncate=1.0), count=100)
    assert link.counts.truncated == link.counts.changed == 100
    assert 50 < link.counts.corrupted < 100  # of those that were cut to nothing no bit is left


@given(seed=seeds, sent=datagrams, less=shares, more=shares)
def test_more_loss_loses_the_same_and_further_ones(seed, sent, less, more):
    less, more = sorted((less, more))
    some, many = (fates(LinkFlaws(loss=share), seed, sent) for share in (less, more))
    assert all(a or not b for a, b in zip(some, many, strict=True))


@given(flaws=any_flaws, seed=seeds, sent=datagrams, begin=st.floats(0, 4))
def test_a_silence_changes_nothing_beside_it(flaws, seed, sent, begin):
    with_one = LinkFlaws(
        **{name: getattr(flaws, name) for name in (*SHARES, "delay", "jitter", "reorder_delay")},
        silences=(*flaws.silences, (begin, begin + 1.0)),
    )
    heard, quiet = fates(flaws, seed, sent), fates(with_one, seed, sent)
    for k, (a, b) in enumerate(zip(heard, quiet, strict=True)):
        assert b == (() if begin <= k * 0.1 < begin + 1.0 else a)


def test_silences_have_beginnings_and_ends():
    silences = ((1.0, 2.0), (2.5, inf))
    link, order = arrivals(LinkFlaws(silences=silences), count=300)
    assert order == [*range(100), *range(200, 250)]
    assert link.lost == link.counts.silenced == 150


@pytest.mark.parametrize(
    "bad",
    [
        *({name: value} for name in SHARES for value in (-0.1, 1.1, nan)),
        *(
            {name: value}
            for name in ("delay", "jitter", "reorder_delay")
            for value in (-1.0, inf, nan)
        ),
        *({"silences": (span,)} for span in ((2.0, 2.0), (3.0, 2.0), (nan, 1.0))),
    ],
)
def test_impossible_flaws_are_refused(bad):
    with pytest.raises(ValueError, match=next(iter(bad))):
        LinkFlaws(**bad)
