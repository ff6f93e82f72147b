"""What a verdict says: the words that counters and pages use, and its sentence."""

import pytest

from motionserver.core.safety.verdict import Reason, Rejection


def test_the_words_of_the_reasons():
    assert [str(reason) for reason in Reason] == [
        "malformed",
        "not-finite",
        "wrong-parent",
        "too-late",
        "too-early",
        "not-cueing",
        "not-at-rest",
        "discontinuous",
        "leg-length",
        "leg-speed",
        "leg-acceleration",
        "leg-jerk",
        "joint-angle",
        "conditioning",
        "passenger-acceleration",
        "no-way-home",
    ]


@pytest.mark.parametrize(
    ("more", "text"),
    [
        ({}, ""),
        ({"leg": 0}, ", leg 1"),
        ({"when": 0.0}, ", at 0.000 s"),
        ({"value": 1.5}, ""),
        ({"allowed": 1.5}, ""),
        ({"value": 0.0, "allowed": 0.25}, ", found 0, allowed 0.25"),
        ({"when": 1.25, "value": 2.0, "allowed": 1.0}, ", at 1.250 s, found 2, allowed 1"),
    ],
)
def test_a_rejection_says_what_it_knows_and_no_more(more, text):
    assert str(Rejection(Reason.TOO_LATE, **more)) == f"plan rejected: too-late{text}"
