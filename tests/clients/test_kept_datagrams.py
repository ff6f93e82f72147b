"""A base that runs for days keeps no receive buffers, and nothing per packet without a bound.

asyncio receives into 256 KiB and shrinks that in place, so that each datagram that is kept holds a
page of memory, whatever its length. No tool sees that from inside: Python counts the bytes of the
shrunk object. So what is told here is that nobody holds the received object itself.
"""

import asyncio
import sys

from moog_host import frame
from motion_clients import moog_emulator
from motion_clients.datagram import own_bytes
from motion_clients.delay_line import DelayLine
from motion_clients.flawed_link import LinkFlaws
from motion_clients.moog_device import MoogDevice
from motion_clients.moog_emulator import MOST_HOSTS, Emulator, run_emulator
from motion_clients.moog_machine import MOST_TRANSITIONS
from motion_clients.moog_wire import MachineState, Mcw
from motion_clients.motion_log import MotionLog

SLOW = LinkFlaws(delay=5.0, duplicate=1.0)


def received():
    """A datagram as a socket makes it, held by nobody else."""
    return bytes(bytearray(frame(Mcw.LENGTH_MODE, (0.0,) * 6)))


def test_a_copy_is_equal_and_another_object():
    data = received()
    assert own_bytes(data) == data
    assert own_bytes(data) is not data


async def test_an_emulator_holds_no_received_object_even_while_links_delay_it():
    with MotionLog() as log:
        async with Emulator(to_base=SLOW, to_host=SLOW, log=log) as emulator:
            data = received()
            before = sys.getrefcount(data)
            emulator.datagram_received(data, ("127.0.0.1", 9))
            assert sys.getrefcount(data) == before
        assert [kept for _, kept in log.records] == [data]


def test_a_log_and_a_delay_line_hold_no_received_object():
    data = received()
    before = sys.getrefcount(data)
    log, line = MotionLog(), DelayLine(SLOW)
    log.write(1, data)
    line.put(0.0, data)
    assert sys.getrefcount(data) == before
    assert line.take(10.0) == [data, data]


def test_an_emulator_of_the_command_line_keeps_no_packets_in_memory(monkeypatch, tmp_path):
    logs = []

    class Watched(MotionLog):
        def __init__(self, *arguments, **named):
            super().__init__(*arguments, **named)
            logs.append(self)

    monkeypatch.setattr(moog_emulator, "MotionLog", Watched)
    path = tmp_path / "motion.log"

    def send(address):
        async def talk():
            transport, _ = await asyncio.get_running_loop().create_datagram_endpoint(
                asyncio.DatagramProtocol, remote_addr=address
            )
            for _ in range(50):
                transport.sendto(received())
                await asyncio.sleep(0.001)
            transport.close()

        talking.append(asyncio.get_running_loop().create_task(talk()))

    talking = []
    verdict = run_emulator("127.0.0.1", 0, duration=0.5, log_path=path, on_ready=send)
    assert verdict["packets"] > 0
    assert len(path.read_text().splitlines()) == verdict["packets"]
    assert [len(log.records) for log in logs] == [0]


async def test_hosts_from_ever_new_ports_do_not_fill_the_verdict():
    async with Emulator() as emulator:
        for port in range(1000, 1000 + 10 * MOST_HOSTS):
            emulator.datagram_received(received(), ("127.0.0.1", port))
        assert len(emulator.summary()["hosts"]) == MOST_HOSTS


def test_states_entered_again_and_again_are_remembered_up_to_a_bound():
    device = MoogDevice()
    for number in range(3 * MOST_TRANSITIONS):
        device._enter((MachineState.STANDBY, MachineState.PARKING)[number % 2])
    assert len(device.transitions) == MOST_TRANSITIONS
    assert device.transitions[-1][1] is MachineState.PARKING
