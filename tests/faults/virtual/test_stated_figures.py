"""What the documents state is what the constants say: no figure is written twice by hand."""

from pathlib import Path

import pytest
from fault_list import FAULTS

from motionserver.guard.ports import DRAIN as GUARD_DATAGRAMS
from motionserver.planner.crowd import CALM_NS, MANY
from motionserver.settings.key_file import SHORTEST_KEY
from motionserver.sources.udp import BUFFER
from motionserver.sources.udp import DRAIN as DATAGRAMS
from motionserver.supervisor.guards import PARK_PATIENCE
from motionserver.supervisor.rundir import MARKER

ROOT = Path(__file__).parents[3]


def words(file):
    return " ".join((ROOT / file).read_text("utf-8").replace("\n#", " ").split())


def test_table_of_faults_says_what_the_faults_say():
    lines = (ROOT / "deploy" / "faults.md").read_text("utf-8").splitlines()
    rows = {
        int(line.split()[1][1:]): [cell.strip() for cell in line.strip("|").split("|")]
        for line in lines
        if line.startswith("| F")
    }
    assert sorted(rows) == sorted(FAULTS)
    for number, fault in FAULTS.items():
        stated = [fault.title, fault.detection, fault.reaction, fault.recovery]
        stated = [text.replace("|", "/") for text in stated]
        assert rows[number][:4] == [f"F{number} {stated[0]}", *stated[1:]]


@pytest.mark.parametrize(
    ("file", "text"),
    [
        ("deploy/faults.md", f"at most {DATAGRAMS} datagrams are read per period"),
        ("deploy/realtime.md", f"A crowd is {MANY} datagrams or more in one period"),
        ("deploy/realtime.md", f"until it has been calm for {CALM_NS / 1e9:g} s"),
        ("deploy/realtime.md", f"The buffer is small ({BUFFER / 1024:g} kB)"),
        (
            "deploy/realtime.md",
            f"at most {DATAGRAMS} datagrams are read per period, {GUARD_DATAGRAMS} by the guard",
        ),
        ("deploy/motionserver.service", f"above the longest wait for parking, {PARK_PATIENCE:g} s"),
        ("deploy/motionserver.toml", f"at least {SHORTEST_KEY} bytes"),
        ("deploy/motionserver.toml", f"marked by the file {MARKER}"),
        ("protocol/README.md", f"with a shared key of at least {SHORTEST_KEY} bytes"),
    ],
)
def test_document_states_the_constant(file, text):
    assert text in words(file)
