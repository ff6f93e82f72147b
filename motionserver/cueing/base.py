"""What a cueing algorithm is: state at hand-over and a stimulus in, a candidate plan out."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Protocol, runtime_checkable

from motionserver.core.axes import Array
from motionserver.core.plan import Plan
from motionserver.core.state import PlatformState, Stimulus
from motionserver.cueing.tuning import Tuning


@dataclass(frozen=True, slots=True)
class Candidate:
    """Knots of a proposed trajectory, before the governor; times[0] = 0 is the hand-over.

    Attributes:
        times: (K,) [s], at most `MAX_KNOTS`, at most `MAX_DURATION`.
        pose: (K, 6), row 0 equal to the state at hand-over.
        velocity: (K, 6), last row zero.
        acceleration: (K, 6), last row zero.
    """

    times: Array
    pose: Array
    velocity: Array
    acceleration: Array


@dataclass(frozen=True, slots=True)
class Report:
    """What an algorithm tells about its last step, for status, figures and plots.

    Attributes:
        x_max: Position limits now, (6,) [m, rad]; the machine's box where not adapted.
        bounded: Axes whose position limit is in force; on the others the legs decide alone.
        shares: Share of each limit that the last candidate uses, by name; 1 is all that a plan
            keeps to, so the largest is what binds. Empty where the algorithm does not tell.
        iterations: Iterations of the solver, summed over its problems; 0 without a solver.
        solver_status: Short word: "solved", "none", or why there is no candidate.
        numbers: Anything else worth a curve, by name, SI.
        reference: What the forecast rests on now, in a few words; empty without a forecast.
    """

    x_max: Array
    iterations: int = 0
    solver_status: str = "none"
    numbers: dict[str, float] = field(default_factory=dict)
    reference: str = ""
    bounded: tuple[int, ...] = tuple(range(6))
    shares: dict[str, float] = field(default_factory=dict)


class Cueing(Protocol):
    """One cueing algorithm. Holds its filter state; knows no clock and no socket.

    The planner calls, in every period: `propose`, then `adopt` with the plan the governor let
    through, which may differ from the candidate (or be the accepted one). Filters re-read their
    state from the plan at the next hand-over, so that what they believe is what is played.

    Attributes:
        name: How it is selected.
        disturbance: Slow estimate of measured minus modelled specific force at the head, (3,)
            [m/s2]; set from outside, added to the predicted output by algorithms that predict.
    """

    name: str
    disturbance: Array

    def propose(
        self, start: PlatformState, parent: Plan, takeover: float, stimulus: Stimulus
    ) -> Candidate | None:
        """Make a candidate that begins at ``start`` and ends at rest.

        Args:
            start: State of the accepted plan at the hand-over; where the candidate begins.
            parent: The accepted plan.
            takeover: Hand-over in the parent's own time [s].
            stimulus: What should be felt now (and the preview, if any).

        Returns:
            The candidate, or None when there is none (solver failed); never raises for numbers.
        """
        ...

    def adopt(self, plan: Plan, kappa: float) -> None:
        """Take note of what was proposed in the end.

        Args:
            plan: The proposed plan; the next period begins on it.
            kappa: Share of the candidate in it, 0..1.
        """
        ...

    def retune(self, tuning: Tuning) -> None:
        """Take other tunables; motion stays continuous because plans are.

        Raises:
            ValueError: It cannot be made with these; then nothing has changed.
        """
        ...

    def report(self) -> Report:
        """Tell about the last step."""
        ...


@runtime_checkable
class ReadsBack(Protocol):
    """A cueing algorithm that tells which tunables it works with now.

    Who does not is taken at its word: what its `Cueing.retune` took without an error is in force.
    """

    @property
    def tuning(self) -> Tuning:
        """Tunables in force, read from the parts that use them; the state between in a ramp."""
        ...
