"""The sections of the configuration: every key with its type, bounds, default and meaning.

The annotated file of `motionserver init` is rendered from these definitions
(`settings.reference`), so that a description here is what people read.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal, Self

from pydantic import Field, field_validator, model_validator

from motionserver.settings.keys import AnyPort, Arm, FilePath, Port, Strict, key, split_address


class ServerSection(Strict):
    """The server itself: folders, log, priorities, black box."""

    run_dir: FilePath = key(
        "",
        "Folder where the processes meet, mode 0700. One platform has one server: a second one on "
        "the same folder is refused. Files in it are deleted at every start, so a folder that "
        "holds anything but an earlier run of this server (marked by the file .motionserver-run) "
        "is refused, and left as it is.",
        empty="below XDG_RUNTIME_DIR or /tmp, one per user and platform port",
    )
    state_dir: FilePath = key(
        "",
        "Folder of what outlives a run: tokens, saved presets.",
        empty="~/.local/state/motionserver",
    )
    log_level: Literal["debug", "info", "warning"] = key("info", "How much is logged.")
    realtime: bool = key(
        True,
        "true: guard and planner ask for SCHED_FIFO 50 and 30, or else for nice -10, and go on "
        "without when neither is permitted; see realtime.md. false: they ask for nothing.",
    )
    blackbox_kept: Annotated[int, Field(ge=0, le=1000)] = key(
        20,
        "How many dumps of the black box are kept in state_dir/blackbox; the oldest goes. Each "
        "holds the last minute before a fault or a killed process, some 1 MB. 0: no black box.",
    )


class PlatformSection(Strict):
    """The machine and its packets."""

    format: str = key(
        "moog-6dof2000e", 'Packet format: "moog-6dof2000e", or the name of an installed plug-in.'
    )
    preset: FilePath = key(
        "t2-compact", "Geometry and hard limits: name of a shipped preset, or path of a .toml file."
    )
    mode: Literal["length", "dof"] = key(
        "length",
        'What the packets carry: "length" (leg lengths) or "dof" (a pose; leg limits then hold for '
        "the declared geometry only).",
    )
    host: str = key("127.0.0.1", "The platform's IP address, a number and no name.")
    port: Port = key(991, "The platform's UDP port.")
    local_host: str = key("127.0.0.1", "Own IP address on the platform's network.")
    local_port: AnyPort = key(
        992,
        "Own UDP port that the platform answers to, 0 = any free one; below 1024 needs "
        "CAP_NET_BIND_SERVICE.",
    )
    rate_hz: Annotated[float, Field(ge=20.0, le=1000.0)] = key(
        60.0,
        "Packets per second the platform expects [Hz]. The guard ticks at the smallest multiple of "
        "at least 240 Hz.",
    )
    length_offset_m: Annotated[float, Field(ge=0.0, le=10.0)] | None = key(
        None,
        'Pin-to-pin length of a leg whose word is zero [m]; mode "length" only.',
        empty="the machine's shortest leg",
        example=0.9022,
    )
    leg_order: tuple[int, int, int, int, int, int] = key(
        (0, 1, 2, 3, 4, 5),
        "Which leg (0 to 5, counter-clockwise from front left) stands in each of the six places of "
        "a packet.",
    )
    heave_neutral_m: Annotated[float, Field(ge=-2.0, le=2.0)] = key(
        -0.2286, 'Heave word of the neutral pose [m]; mode "dof" only.'
    )
    engage_word: Literal[175, 180] = key(180, "Command word that lifts the base: hosts differ.")
    head_m: tuple[Arm, Arm, Arm] | None = key(
        None,
        "The driver's head from the motion reference point: forward, left, up [m].",
        empty="the machine's",
        example=(0.0, 0.0, 0.0),
    )

    @field_validator("leg_order")
    @classmethod
    def _permutation(cls, value: tuple[int, ...]) -> tuple[int, ...]:
        if sorted(value) != list(range(6)):
            raise ValueError("leg_order must hold 0, 1, 2, 3, 4, 5, each once")
        return value


class SourceSection(Strict):
    """One block per way that motion comes in; several may listen, one drives at a time."""

    kind: Literal["native", "beamng", "zenoh", "imu"] = key(
        "native",
        '"native" (protocol/README.md), "beamng", "zenoh", or "imu": a sensor on the platform '
        "itself, whose readings correct the model.",
    )
    listen: str = key("127.0.0.1:4600", "Own address: UDP host:port, for zenoh TCP host:port.")
    key_file: FilePath = key(
        "",
        "File with the shared secret of signed packets, at least 16 bytes, mode 0600.",
        empty="unsigned",
    )
    topic: str = key("motion/0/in/cue", 'Zenoh key that cues are put on; kind "zenoh" only.')
    preview_topic: str = key(
        "",
        "Zenoh key of previews that are put apart from the cues, such as "
        '"motion/0/in/preview": native cues with a preview block, also for cues that come by '
        'another source; kind "zenoh" only.',
        empty="previews come with the cues",
    )
    zenoh_config: FilePath = key(
        "",
        "Zenoh's own file with certificates, passwords and access list, such as "
        'zenoh-secure.json5; with a certificate in it "listen" speaks TLS; kind "zenoh" only.',
        empty="plain TCP",
    )
    connect: list[str] = key(
        [],
        'Zenoh endpoints to connect to, for example "tcp/192.0.2.7:7447"; kind "zenoh" only.',
    )
    allow_unsigned: bool = key(
        False,
        "true: take unsigned packets from other computers. Anybody on that network can then move "
        "the platform.",
    )

    @field_validator("listen")
    @classmethod
    def _address(cls, value: str) -> str:
        split_address(value)
        return value

    @model_validator(mode="after")
    def _preview_by_zenoh(self) -> Self:
        if self.zenoh_config and self.kind != "zenoh":
            raise ValueError('zenoh_config needs kind = "zenoh"; other kinds are not encrypted')
        if self.preview_topic and self.kind != "zenoh":
            raise ValueError('preview_topic needs kind = "zenoh"; add a source of that kind')
        if self.preview_topic and self.preview_topic == self.topic:
            raise ValueError("preview_topic must differ from topic; cues may bring previews too")
        return self


class CueingSection(Strict):
    """What starts; the page can change all of this while the platform moves, within bounds."""

    algorithm: str = key(
        "mpc",
        'Algorithm: "mpc" (six axes at once), "thondel2014" (the paper\'s four channels), '
        '"classical" (washout), or the name of an installed plug-in.',
    )
    scale: Annotated[float, Field(ge=0.0, le=1.0)] = key(
        0.6, "Share of the vehicle's motion that is wanted."
    )
    vehicle_head_m: tuple[Arm, Arm, Arm] = key(
        (0.0, 0.0, 0.0),
        "The driver's head in the vehicle, from the point whose motion is sent: forward, left, up "
        "[m].",
    )
    budget_ms: Annotated[float, Field(ge=1.0, le=50.0)] = key(
        10.0,
        "How long before a packet the planner wakes to plan for it [ms], at most 0.8 of its "
        "period. It holds until the planner has measured how long its plans take, and follows "
        "them.",
    )
    rate_max_hz: Annotated[float, Field(ge=20.0, le=200.0)] = key(
        120.0,
        "Fastest planner rate [Hz]: it plans for every packet, or for every second, third ...",
    )
    tuning: dict[str, Any] = key(
        {},
        """Any tunable of the page by its name and in its unit. Some:
  tilt_rate_deg_s = 3.0       how fast the cabin may tilt
  reference = "ar"            what surge and sway are expected to do: "constant", "fade", "ar",
                              "vehicle" (needs pedals and steering), "learned"
  predictor = "/path/my.json" what "learned" uses: written by `motionserver tune --predictor my`
  mpc_trust_s = 1.0           how far ahead that is trusted; a preview is trusted to its end
  perception = "none"         or "telban-cardullo", "reid-nahon": weigh errors as the inner ear
  backend = "daqp"            or "piqp", "osqp" (inexact), "hpipm" (extra motionserver[hpipm])
""",
        empty="the algorithm's own",
    )


class PlannerSection(Strict):
    """Algorithms that are computed for comparison."""

    side_engines: list[str] = key(
        [],
        "Algorithms that receive the same input as the driving one, each with a simulated platform "
        "only: the page compares them with what drives, and `motionserver record` keeps them. They "
        "use the time that is left of a period and never delay the driving one; the page can "
        'change them. For example ["thondel2014", "classical"].',
    )


class OperatorSection(Strict):
    """Who may raise the platform."""

    engage: Literal["console", "http", "auto"] = key(
        "console",
        'Where engaging is accepted from: "console" (the command `motionserver engage` on this '
        'computer), "http" (the page too) or "auto" (it RISES BY ITSELF once a source is fresh).',
    )
    enable_input: FilePath = key(
        "",
        "File that reads 1 while somebody at the platform holds the enable switch, such as "
        "/sys/class/gpio/gpio17/value. The guard reads it at each engage from the page; without "
        "one a page on the network cannot engage.",
        empty="none",
    )


class WebSection(Strict):
    """The page in the browser and its HTTP interface."""

    enabled: bool = key(
        True, "Whether there is a page. It runs at nice 10 and cannot disturb the motion."
    )
    host: str = key(
        "127.0.0.1",
        "Own address of the page; another than loopback needs tls_cert and tls_key.",
    )
    port: AnyPort = key(8080, "TCP port of the page, 0 = any free one.")
    tokens_file: FilePath = key(
        "",
        "File of the three tokens (viewer, tuner, operator), made at the first start, mode 0600.",
        empty="tokens.json in state_dir",
    )
    tls_cert: FilePath = key("", "Certificate chain, PEM.", empty="no TLS")
    tls_key: FilePath = key("", "Its private key, PEM.")
    allowed_hosts: list[str] = key(
        [], "Names the page may be asked under beside its own address, against DNS rebinding."
    )
