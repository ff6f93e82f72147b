"""What can be chosen about an emulated Moog base, and the figures assumed for it."""

from __future__ import annotations

from dataclasses import dataclass, field

from .hexapod_legs import T2_COMPACT, HexapodGeometry, Six
from .moog_wire import CommandMode, DofAxes, Mcw

LENGTH_TOLERANCE = 1e-6
"""Slack of every range test [m, rad].

A word of 0.2789 m is off by up to 1.5e-8 m as float32; a leg length made of six such DOF words,
by up to 3e-8 m. So a micrometre is never a rounding error, and never matters to a machine.
"""


@dataclass(frozen=True, slots=True, kw_only=True)
class MoogConfig:
    """An emulated 6DOF2000E; figures without a readable source are assumptions and say so.

    Attributes:
        geometry: Joints and legs; the real machine's are not public.
        axes: Signs and neutral heave of the DOF words.
        clamps: Allowed (lowest, highest) DOF words in wire order [rad, m].
        engage_words: Mode control words that lift the base; hosts differ.
        initial_mode: Command mode after power-up.
        frame_period: Time between two commands [s].
        power_up_duration: Shortest stay in POWER_UP [s].
        lift_duration: From home to neutral [s]; 2 to 5.
        park_speed: Greatest leg speed while lowering [m/s] (assumed).
        park_acceleration: Greatest leg acceleration while lowering [m/s²] (assumed).
        home_heave: Heave of the parked platform above neutral, a negative number [m] (assumed).
        leg_speed: Greatest speed of a drive [m/s]: 1.3 times what a host may ask for.
        leg_acceleration: Greatest acceleration of a drive [m/s²]: 1.3 times likewise.
        jump_max: Largest leg step from one command to the next before the envelope fault [m].
        silence_max: Silence while raised before the comm fault [s] (assumed).
        feedback_lag: Time constant of the reported position [s].
        feedback_delay: Further delay of the reported position [s]; 1 to 2 frames.
        estop_lowers: Whether the base lowers itself with the E-stop held (on its batteries), or
            stands until the E-stop is released (assumed either way).
    """

    geometry: HexapodGeometry = T2_COMPACT
    axes: DofAxes = field(default_factory=DofAxes)
    clamps: tuple[tuple[float, float], ...] = (
        (-0.50605, 0.50605),
        (-0.57585, 0.57585),
        (-0.4572, 0.0),
        (-0.381, 0.381),
        (-0.50605, 0.50605),
        (-0.381, 0.381),
    )
    engage_words: frozenset[int] = frozenset({Mcw.ENGAGE, Mcw.START})
    initial_mode: CommandMode = CommandMode.DOF
    frame_period: float = 1 / 60
    power_up_duration: float = 0.5
    lift_duration: float = 3.0
    park_speed: float = 0.1
    park_acceleration: float = 0.5
    home_heave: float = -0.17
    leg_speed: float = 1.3 * 0.6
    leg_acceleration: float = 1.3 * 8.0
    jump_max: float = 0.020
    silence_max: float = 0.5
    feedback_lag: float = 0.010
    feedback_delay: float = 1.5 / 60
    estop_lowers: bool = True

    def __post_init__(self) -> None:
        """Refuse figures that no such base could have."""
        if not 2.0 <= self.lift_duration <= 5.0:
            raise ValueError(
                f"lift_duration {self.lift_duration:g} s: the lift takes 2 to 5 s; choose within"
            )
        for name, legs in (("home", self.home), ("neutral", self.neutral)):
            if not all(0.0 <= leg <= self.geometry.stroke for leg in legs):
                raise ValueError(
                    f"{name} extensions {[round(x, 4) for x in legs]} m leave the stroke 0.."
                    f"{self.geometry.stroke:g} m; change home_heave or the geometry"
                )

    @property
    def home(self) -> Six:
        """Leg extensions of the parked base, six [m]."""
        return self.geometry.extensions((0.0, 0.0, self.home_heave, 0.0, 0.0, 0.0))

    @property
    def neutral(self) -> Six:
        """Leg extensions of the neutral pose, six [m]."""
        return self.geometry.extensions((0.0,) * 6)

    def commanded_extensions(self, words: Six, mode: CommandMode) -> Six:
        """Leg extensions that the six words of a NEW_POSITION ask for, six [m]; unchecked."""
        if mode is CommandMode.LENGTH:
            return words
        return self.geometry.extensions(self.axes.to_pose(words))

    def is_within_clamps(self, words: Six, mode: CommandMode) -> bool:
        """Whether the words keep the protocol's own range; LENGTH words have the stroke only."""
        return mode is CommandMode.LENGTH or all(
            low - LENGTH_TOLERANCE <= word <= high + LENGTH_TOLERANCE
            for word, (low, high) in zip(words, self.clamps, strict=True)
        )

    def is_within_stroke(self, extensions: Six) -> bool:
        """Whether six leg extensions [m] are mechanically possible."""
        return all(map(self.is_leg_within_stroke, extensions))

    def is_leg_within_stroke(self, extension: float) -> bool:
        """Whether one leg extension [m] is mechanically possible."""
        return -LENGTH_TOLERANCE <= extension <= self.geometry.stroke + LENGTH_TOLERANCE
