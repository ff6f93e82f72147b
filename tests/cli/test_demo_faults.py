"""The packets of the fault "nan" are refused for what they hold, not for how they are made."""

import pytest
from motion_protocol import decode_cue
from motion_protocol.errors import NotFiniteError

from motionserver.cli.demo_faults import nan_packet


@pytest.mark.parametrize("sequence", [0, 1, 2**32 - 1])
def test_a_packet_of_no_numbers_is_well_formed(sequence):
    with pytest.raises(NotFiniteError):
        decode_cue(nan_packet(sequence))
