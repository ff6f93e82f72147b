"""What the documents and the public names promise about the wire contract."""

import re
import zlib
from pathlib import Path

import motion_protocol
from motion_protocol import ProtocolError, errors
from motion_protocol.blocks import DRIVER_LAYOUT, MOTION_LAYOUT, PREVIEW_LAYOUT
from motion_protocol.cue import CUE, CUE_LAYOUT
from motion_protocol.framing import HEADER
from motion_protocol.status import BODY, STATUS_KIND, STATUS_LAYOUT

PROTOCOL = Path(__file__).parents[2] / "protocol"


def test_public_names_exist_and_are_complete():
    names = motion_protocol.__all__
    assert len(names) == len(set(names))
    assert all(hasattr(motion_protocol, name) for name in names)
    assert {kind.__name__ for kind in ProtocolError.__subclasses__()} <= set(names)


def test_every_error_is_drawn_with_its_reason():
    for kind in ProtocolError.__subclasses__():
        assert re.search(rf"- {kind.__name__} +{kind.reason} ", errors.__doc__)
    reasons = [kind.reason for kind in ProtocolError.__subclasses__()]
    assert len(reasons) == len(set(reasons))


def test_sizes_are_those_of_the_byte_tables():
    sizes = [layout.size for layout in (HEADER, MOTION_LAYOUT, PREVIEW_LAYOUT, DRIVER_LAYOUT, BODY)]
    assert sizes == [44, 44, 12, 20, 44]


def test_layout_texts_and_seeds_are_frozen():
    assert (zlib.crc32(CUE_LAYOUT), zlib.crc32(STATUS_LAYOUT)) == (0x1BA023E3, 0x076E0CAC)
    assert (CUE.crc_seed, STATUS_KIND.crc_seed) == (0x1BA023E3, 0x076E0CAC)
    readme = (PROTOCOL / "README.md").read_text(encoding="utf-8")
    for text in (CUE_LAYOUT.decode(), STATUS_LAYOUT.decode(), "0x1BA023E3", "0x076E0CAC"):
        assert text in readme


def test_readme_lists_every_reason():
    readme = (PROTOCOL / "README.md").read_text(encoding="utf-8")
    for kind in ProtocolError.__subclasses__():
        assert f"`{kind.reason}`" in readme
