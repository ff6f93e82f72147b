"""CueSender: five lines from a simulator to the motion server."""

from __future__ import annotations

import contextlib
import secrets
import socket
import time
from collections.abc import Callable
from types import TracebackType
from typing import Final, Self

from motion_protocol import (
    DEFAULT_PORT,
    MAX_DATAGRAM,
    Cue,
    DriverInputs,
    Flags,
    Mode,
    Motion,
    Preview,
    ProtocolError,
    Reference,
    Status,
    TimedPreview,
    Vector3,
    decode_status,
    encode_cue,
    sequence_delta,
)

from .address import parse_address
from .outage import Outage

_DRAIN_MAX: Final = 64
_ROUND_TRIPS: Final = 16
_LATE: Final = 16
"""Statuses by which one may be overtaken; there are about ten a second."""
_AT_REST: Final = Motion((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))


class CueSender:
    """Sends cues over UDP and reads what the server answers, never blocking.

    A simulator must not stumble because the motion server is not there: what the network
    refuses is counted, not raised. Values that cannot be sent (NaN, out of a field) are raised.

    Example:
        with CueSender("127.0.0.1:4600") as cue:
            while driving:
                cue.send(acceleration=(ax, ay, az), rates=(p, q, r), speed=v)

    Attributes:
        last_error: What the network last refused, or None.
        refused_replies: Datagrams that were no status for this session.
        sent: Packets handed to the network.
        session: Random number of this sender, 32 bits. With a key it is taken anew when the server
            was away: after a power cut a server believes no session that it had heard before.
        unsent: Packets the network refused.
    """

    def __init__(
        self,
        address: str = f"127.0.0.1:{DEFAULT_PORT}",
        *,
        key: bytes | None = None,
        session: int | None = None,
        clock_ns: Callable[[], int] = time.monotonic_ns,
    ) -> None:
        """Open the socket; nothing is sent yet.

        Args:
            address: `host`, `host:port` or `[ipv6]:port` of the server.
            key: Secret shared with the server; with it every packet is signed.
            session: Session number; random unless given.
            clock_ns: Monotonic clock [ns].

        Raises:
            ValueError: The address cannot be read.
            OSError: The host's name cannot be resolved.
        """
        host, port = parse_address(address, DEFAULT_PORT)
        family, kind, protocol, _, peer = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)[0]
        self._socket = socket.socket(family, kind, protocol)
        self._socket.setblocking(False)
        # A connected socket hears the server only.
        self._socket.connect(peer)
        self._key = key
        self._clock_ns = clock_ns
        self._start_ns = clock_ns()
        self._sequence = 0
        self._last_motion = _AT_REST
        self._status: Status | None = None
        self._round_trips: list[tuple[float, int]] = []
        self._is_open = True
        self._outage = Outage()
        self.session = secrets.randbits(32) if session is None else session
        self.sent = 0
        self.unsent = 0
        self.refused_replies = 0
        self.last_error: OSError | None = None

    def send(
        self,
        acceleration: Vector3 | None = None,
        rates: Vector3 = (0.0, 0.0, 0.0),
        *,
        specific_force: Vector3 | None = None,
        speed: float | None = None,
        attitude: tuple[float, float] | None = None,
        yaw: float | None = None,
        reference: Reference = Reference.UNSPECIFIED,
        sim_time_ns: int | None = None,
        mode: Mode = Mode.DRIVE,
        flags: Flags | None = None,
        preview: Preview | TimedPreview | None = None,
        driver: DriverInputs | None = None,
    ) -> int:
        """Send one cue, ISO 8855 body axes.

        Args:
            acceleration: Kinematic acceleration x, y, z, zero at rest [m/s^2]; or else
            rates: Body rates p, q, r [rad/s].
            specific_force: What an accelerometer reads, +9.81 in z at rest [m/s^2].
            speed: Forward speed [m/s].
            attitude: Roll (positive left side up) and pitch (positive nose down) [rad].
            yaw: Heading, positive to the left [rad].
            reference: The point the accelerations belong to.
            sim_time_ns: The simulation's time of the values [ns]; this sender's own if None.
            mode: What the simulator is doing.
            flags: Further flags; gravity is flagged by itself.
            preview: What is expected next; `motion_protocol.preview_times` chooses instants for a
                `TimedPreview`.
            driver: What the driver does at the controls.

        Returns:
            The packet's sequence number.

        Raises:
            ValueError: Both or neither of acceleration and specific force are given.
            ProtocolError: A value cannot be sent; its field is named.
        """
        marked = Flags(0) if flags is None else flags
        if acceleration is not None and specific_force is None:
            felt = acceleration
        elif specific_force is not None and acceleration is None:
            felt = specific_force
            marked |= Flags.GRAVITY_INCLUDED
        else:
            raise ValueError(
                "send() takes either acceleration (zero at rest) or specific_force "
                "(+9.81 in z at rest): give exactly one of them"
            )
        motion = Motion(felt, rates, attitude, yaw, speed, reference)
        sequence = self._emit(mode, motion, marked, sim_time_ns, preview, driver)
        self._last_motion = motion
        return sequence

    def pause(self, *, sim_time_ns: int | None = None) -> int:
        """Say that the simulation stands still; repeat it at your rate while it lasts."""
        last = self._last_motion
        motion = Motion(
            (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), last.attitude, last.yaw, last.speed, last.reference
        )
        return self._emit(Mode.PAUSE, motion, Flags(0), sim_time_ns, None, None)

    def teleport(self, *, sim_time_ns: int | None = None) -> int:
        """Say that the vehicle was just put elsewhere and stands; then go on with `send`.

        If it moves at once, call `send` with `mode=Mode.TELEPORT` instead.
        """
        return self._emit(Mode.TELEPORT, _AT_REST, Flags(0), sim_time_ns, None, None)

    def bye(self) -> int:
        """Say that this client leaves. `close` does it too."""
        return self._emit(Mode.BYE, None, Flags(0), None, None, None)

    def renew(self) -> None:
        """Go on as another session: what to do when a signed one is refused as `session-over`.

        It is done without being asked when nobody listened for half a second. To a server that
        still hears the former session this is a second client, which has to wait.
        """
        self.session = secrets.randbits(32)
        self._sequence = 0
        self._status = None

    def status(self) -> Status | None:
        """Read the answers that have come and return the newest of all, None before the first."""
        for _ in range(_DRAIN_MAX):
            try:
                data = self._socket.recv(MAX_DATAGRAM + 1)
            except BlockingIOError:
                break
            except OSError as error:  # the port was closed: reported once per packet sent
                self._refused(error)
                continue
            self._take(data)
        return self._status

    @property
    def round_trip(self) -> float | None:
        """Smallest round trip of the last answers [s]; holds the delay until `status` was called.

        None before the first answer. RFC 5905, section 8.
        """
        return min(self._round_trips)[0] if self._round_trips else None

    @property
    def clock_offset_ns(self) -> int | None:
        """Server's clock minus this one's, from the answer with the smallest round trip [ns]."""
        return min(self._round_trips)[1] if self._round_trips else None

    def close(self) -> None:
        """Say bye and close the socket; a second call does nothing."""
        if not self._is_open:
            return
        self.bye()
        self._is_open = False
        self._socket.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()

    def _emit(
        self,
        mode: Mode,
        motion: Motion | None,
        flags: Flags,
        sim_time_ns: int | None,
        preview: Preview | TimedPreview | None,
        driver: DriverInputs | None,
    ) -> int:
        now = self._clock_ns()
        time_ns = now - self._start_ns if sim_time_ns is None else sim_time_ns
        sequence = self._sequence
        cue = Cue(self.session, sequence, time_ns, now, motion, mode, flags, preview, driver)
        data = encode_cue(cue, self._key)
        self._sequence = (sequence + 1) & 0xFFFFFFFF
        if self._sequence == 0 and self._key is not None:
            # of a signed session no sequence is believed twice
            self.renew()
        try:
            self._socket.send(data)
            self.sent += 1
        except OSError as error:
            self.unsent += 1
            self._refused(error)
        return sequence

    def _refused(self, error: OSError) -> None:
        """Take note of what the network refused."""
        self.last_error = error
        away = isinstance(error, ConnectionRefusedError) and self._outage.refused(self._clock_ns())
        if away and self._key is not None:
            self.renew()

    def _take(self, data: bytes) -> None:
        status: Status | None = None
        with contextlib.suppress(ProtocolError):
            status = decode_status(data, self._key)
        if status is None or status.session != self.session:
            self.refused_replies += 1
            return
        away = self._clock_ns() - status.echo_sender_time_ns
        held = status.send_time_ns - status.receive_time_ns
        ahead = status.receive_time_ns - status.echo_sender_time_ns
        offset = (ahead + ahead - away + held) // 2
        self._round_trips = [*self._round_trips, ((away - held) * 1e-9, offset)][-_ROUND_TRIPS:]
        former = self._status
        # a little behind came late; far behind counts a server that was started again
        if former is None or not -_LATE < sequence_delta(status.sequence, former.sequence) <= 0:
            self._status = status
