"""All faults by number, and which two cannot happen together."""

from itertools import combinations

import scenes_around
import scenes_client
import scenes_muted
import scenes_packets
import scenes_planner
import scenes_platform
import scenes_process

FAULTS = {
    cls.number: cls
    for room in (
        scenes_client,
        scenes_packets,
        scenes_platform,
        scenes_planner,
        scenes_process,
        scenes_around,
        scenes_muted,
    )
    for cls in room.SCENES
}
REASONS = {
    frozenset((8, 2)): "a signed packet with a forged value is a rogue's, not the owner's",
    frozenset((8, 4)): "likewise",
    frozenset((8, 5)): "likewise",
    frozenset((8, 34)): "likewise",
    frozenset((32, 9)): "a flood of UDP does not reach a Zenoh input",
    frozenset((32, 33)): "a Zenoh input has no socket of its own to fail",
    frozenset((25, 35)): "both are before the start, and each needs its own",
    frozenset((22, 23)): "who is asked to end is not started again",
    frozenset((22, 24)): "likewise",
    frozenset((23, 24)): "one guard dies once",
    frozenset((22, 38)): "who is asked to end is asked once",
    frozenset((23, 38)): "who is asked to end is not started again",
    frozenset((24, 38)): "likewise",
    frozenset((37, 38)): "one wire is silent once",
    frozenset((14, 15)): "one solver fails in one way at a time",
    frozenset((14, 16)): "likewise",
    frozenset((15, 16)): "likewise",
}
"""Pairs that are not played, and why."""
FORESEEN = {
    (13, 24): "a leg is stuck far from what the base holds while a guard that knows nothing begins "
    "where the legs are measured: only the base can know, and its envelope check refuses it"
}
"""Pairs in which a first setpoint is a jump for the base, and why: it must not move by it."""


def pairs():
    """Every pair that can happen together, (lower, higher) number."""
    return [two for two in combinations(sorted(FAULTS), 2) if frozenset(two) not in REASONS]
