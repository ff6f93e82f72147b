import asyncio
import json
import signal
import socket
import subprocess
import sys
from pathlib import Path

import motion_clients
import motion_protocol
import pytest
from moog_host import frame, parse
from motion_clients.flawed_link import LinkFlaws
from motion_clients.moog_device import MoogDevice
from motion_clients.moog_emulator import Emulator, run_emulator
from motion_clients.moog_wire import MachineState
from motion_clients.motion_log import MotionLog, read_motion_log
from motion_protocol import Flags, decode_cue


class LiveHost(asyncio.DatagramProtocol):
    def __init__(self):
        self.replies = asyncio.Queue()

    def connection_made(self, transport):
        self.transport = transport

    def datagram_received(self, data, addr):
        self.replies.put_nowait(data)

    async def ask(self, datagram):
        self.transport.sendto(datagram)
        return await asyncio.wait_for(self.replies.get(), 5.0)

    async def ask_until(self, datagram, state):
        """Ask at the pace of the replies until the base is in a state."""
        for _ in range(3000):
            if parse(await self.ask(datagram))[2] & 15 == state:
                return
            await asyncio.sleep(1 / 60)
        pytest.fail(f"the base never came to {state.name}")


async def until(is_true):
    for _ in range(5000):
        if is_true():
            return
        await asyncio.sleep(0.001)
    pytest.fail("what was waited for never came")


async def connect(emulator):
    loop = asyncio.get_running_loop()
    _, host = await loop.create_datagram_endpoint(LiveHost, remote_addr=emulator.address)
    return host


async def test_live_base_starts_lifts_and_parks_over_udp(tmp_path):
    path = tmp_path / "motion.log"
    readings = []
    with MotionLog(path) as log:
        emulator = Emulator(log=log, send_force=lambda *reading: readings.append(reading))
        async with emulator:
            host = await connect(emulator)
            await host.ask_until(frame(170), MachineState.IDLE)
            await host.ask_until(frame(180), MachineState.ENGAGED)
            for _ in range(10):
                await host.ask(frame(130))
            await host.ask_until(frame(210), MachineState.IDLE)
            host.transport.sendto(b"noise")
            await host.ask(frame(170))
            host.transport.close()
    summary = json.loads(json.dumps(emulator.summary()))
    assert summary["violations"] == 0
    assert summary["ended_safe"]
    assert summary["states_visited"][-4:] == ["STANDBY", "ENGAGED", "PARKING", "IDLE"]
    assert summary["wrong_size"] == 1
    assert summary["replies"] == summary["packets"] - 1
    assert summary["packets"] == len(list(read_motion_log(path)))
    assert len(summary["hosts"]) == 1
    assert len(readings) > 100


async def test_live_base_answers_every_host_and_counts_losses():
    async with Emulator(
        to_base=LinkFlaws(loss=0.5), to_host=LinkFlaws(delay=0.001, duplicate=1.0), seed=3
    ) as emulator:
        one, two = await connect(emulator), await connect(emulator)
        for _ in range(50):
            one.transport.sendto(frame(170))
            two.transport.sendto(frame(170))
        await until(lambda: emulator.summary()["packets"] == 100)
        summary = emulator.summary()
        assert len(summary["hosts"]) == 2
        assert 20 < summary["lost_to_base"] < 80
        answers = 2 * (100 - summary["lost_to_base"])
        await until(lambda: one.replies.qsize() + two.replies.qsize() == answers)
        assert emulator.summary()["replies"] == answers
        one.transport.close()
        two.transport.close()


async def test_mishap_happens_to_a_running_base():
    async with Emulator(mishaps=[(0.05, MoogDevice.press_estop)]) as emulator:
        host = await connect(emulator)
        await host.ask_until(frame(170), MachineState.FAULT2)
        assert parse(await host.ask(frame(170)))[1] & 0x80
        assert emulator.summary()["faults"] == ["ESTOP"]
        host.transport.close()


async def test_replies_go_to_the_configured_port_of_the_host():
    loop = asyncio.get_running_loop()
    _, listener = await loop.create_datagram_endpoint(LiveHost, local_addr=("127.0.0.1", 0))
    port = listener.transport.get_extra_info("sockname")[1]
    async with Emulator(reply_port=port) as emulator:
        host = await connect(emulator)
        host.transport.sendto(frame(170))
        assert len(await asyncio.wait_for(listener.replies.get(), 5.0)) == 40
        assert host.replies.empty()
        host.transport.close()
    listener.transport.close()


def test_stopped_emulator_has_no_address():
    with pytest.raises(RuntimeError, match="start"):
        _ = Emulator().address


def test_run_for_a_while_writes_its_verdict(tmp_path):
    addresses = []
    verdict = run_emulator(
        "127.0.0.1",
        0,
        duration=0.05,
        summary_path=tmp_path / "verdict.json",
        on_ready=addresses.append,
    )
    assert addresses[0][1] > 0
    assert json.loads((tmp_path / "verdict.json").read_text(encoding="utf-8")) == verdict
    assert verdict["ended_safe"]


def test_run_sends_what_its_platform_feels():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
        receiver.bind(("127.0.0.1", 0))
        receiver.settimeout(5.0)
        run_emulator("127.0.0.1", 0, duration=0.2, force_to=receiver.getsockname())
        cue = decode_cue(receiver.recv(2048))
    assert cue.flags & Flags.MEASURED_AT_PLATFORM
    assert cue.motion.acceleration == pytest.approx((0, 0, 9.80665), abs=0.5)


def test_run_ends_with_a_signal():
    script = (
        "from motion_clients.moog_emulator import run_emulator\n"
        "v = run_emulator('127.0.0.1', 0, on_ready=lambda a: print('ready', flush=True))\n"
        "print(v['state'])\n"
    )
    folders = [str(Path(p.__file__).parents[1]) for p in (motion_clients, motion_protocol)]
    with subprocess.Popen(
        [sys.executable, "-c", script],
        stdout=subprocess.PIPE,
        text=True,
        env={"PYTHONPATH": ":".join(folders)},
    ) as process:
        assert process.stdout.readline() == "ready\n"
        process.send_signal(signal.SIGTERM)
        assert process.communicate(timeout=20)[0].strip() in ("POWER_UP", "IDLE")
        assert process.returncode == 0
