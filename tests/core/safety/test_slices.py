"""Slices: all of them say what the whole says, and the blocks of a long table."""

from hypothesis import given
from hypothesis import strategies as st

from motionserver.core.safety.slices import LEAST, blocks, whole


def counted(slices, done):
    for number in range(slices):
        done.append(number)
        yield
    return "result"


def test_the_whole_is_all_slices_and_their_result():
    done = []
    assert whole(counted(3, done)) == "result"
    assert done == [0, 1, 2]


def test_sixteen_rows_are_a_block_and_fewer_join_the_last_one():
    assert list(blocks(76, 30)) == [(0, 30), (30, 60), (60, 76)]
    assert list(blocks(75, 30)) == [(0, 30), (30, 75)]
    assert list(blocks(60, 30)) == [(0, 30), (30, 60)]
    assert list(blocks(5, 30)) == [(0, 5)]
    assert not list(blocks(0, 30))


@given(st.integers(0, 5000), st.integers(1, 700))
def test_blocks_hold_every_row_once_and_none_is_tiny(count, size):
    rows = [row for begin, end in blocks(count, size) for row in range(begin, end)]
    assert rows == list(range(count))
    sizes = [end - begin for begin, end in blocks(count, size)]
    assert all(length <= size + LEAST for length in sizes)
    assert all(length >= min(size, LEAST) for length in sizes) or count < LEAST
