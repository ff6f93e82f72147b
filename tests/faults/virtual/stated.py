"""Figures that the table of faults states, from the constants that make them true."""

from motionserver.core.intake.intake import FADE_OUT
from motionserver.core.intake.spoilage import MOST_BAD
from motionserver.core.safety.watchdog import Patience
from motionserver.settings.tuning_book import CHANGES_PER_SECOND
from motionserver.sources.udp import DRAIN as DATAGRAMS
from motionserver.supervisor.standstill import PATIENCE as STANDS_STILL
from motionserver.telemetry.requests import DRAIN as REQUESTS

P = Patience()
NUMBERS = ("no", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten")

FADE_AND_PARK = f"HOLD, fade {FADE_OUT:g} s; PARKING after {P.hold:g} s"
PAUSED = f"{P.pause / 60:g} min"
FRESH = f"fresh for {P.fresh:g} s: RUN; parked: a new engage"
BAD_SHARE = f"packet dropped and counted; more than {MOST_BAD:.0%} over 1 s: HOLD".replace(
    "%", " %"
)
FLOOD = f"at most {DATAGRAMS} datagrams are read per period"
NO_SIGN = f"its end; no sign of life for {STANDS_STILL:g} s"
REQUESTS_READ = f"{NUMBERS[REQUESTS]} requests per tick, the queue's own bound"
NO_SOLUTION = f"the accepted plan plays to rest; after {P.plans} periods HOLD, then PARKING"
NO_PLAN = f"no new plan for {P.plans} periods"
TO_REST = f"HOLD, the accepted plan to rest, PARKING after {P.hold:g} s"
REPLACED = f"another planner once parked; for one that stands still after {STANDS_STILL:g} s"
CHANGES = f"bounds of every field, version, {NUMBERS[CHANGES_PER_SECOND]} changes a second"
SILENT_BASE = f"age of the newest answer > max({P.feedback * 1e3:.0f} ms, 6 T)"
ASTRAY = (
    f"difference to the command > {P.track * 1e3:g} mm + {P.track_lag:g} s x leg speed for "
    f"{P.track_time * 1e3:g} ms"
)
NO_ANSWER = f"no valid answer for {P.valid:g} s"
GAP = f"slots are skipped, the plan's clock pauses; a gap above {P.gap:g} s: HOLD"
SUSPENDED = f"the plan's clock pauses; above {P.gap:g} s HOLD; the base reports its loss: FAULT"
