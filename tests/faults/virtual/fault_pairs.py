"""Two faults at once, drawn by seed."""

from random import Random

from fault_list import pairs


def pairs_of(seed, count):
    """So many different pairs that can happen together."""
    return sorted(Random(seed).sample(pairs(), count))
