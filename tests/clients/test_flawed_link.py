import pytest
from hypothesis import given
from hypothesis import strategies as st
from motion_clients.flawed_link import FlawedLink, LinkFlaws


def arrivals(flaws, seed=0, count=2000):
    link = FlawedLink(flaws, seed=seed)
    sent = [(k * 0.01, link.delays(k * 0.01)) for k in range(count)]
    order = sorted((at + delay, k) for k, (at, delays) in enumerate(sent) for delay in delays)
    return link, [k for _, k in order]


def test_sound_link_delivers_all_once_at_once():
    link, order = arrivals(LinkFlaws())
    assert order == list(range(2000))
    assert link.lost == 0


def test_loss_has_its_rate():
    link, order = arrivals(LinkFlaws(loss=0.1))
    assert link.lost == 2000 - len(order)
    assert 140 < link.lost < 260


def test_duplicates_and_overtaking_happen():
    _, order = arrivals(LinkFlaws(duplicate=0.1, reorder=0.1))
    assert 2140 < len(order) < 2260
    assert order != sorted(order)


def test_silence_has_a_beginning_and_an_end():
    link, order = arrivals(LinkFlaws(silent_from=1.0, silent_until=2.0), count=300)
    assert link.lost == 100
    assert not set(order) & set(range(100, 200))


@given(delay=st.floats(0, 1), jitter=st.floats(0, 1), seed=st.integers(0, 99))
def test_delay_stays_within_its_jitter_and_repeats_with_its_seed(delay, jitter, seed):
    flaws = LinkFlaws(delay=delay, jitter=jitter)
    one, two = FlawedLink(flaws, seed=seed), FlawedLink(flaws, seed=seed)
    for k in range(5):
        (value,) = one.delays(k)
        assert delay <= value <= delay + jitter
        assert two.delays(k) == (value,)


@pytest.mark.parametrize("bad", [{"loss": 1.1}, {"duplicate": -0.1}, {"delay": -1.0}])
def test_impossible_flaws_are_refused(bad):
    with pytest.raises(ValueError, match=next(iter(bad))):
        LinkFlaws(**bad)
