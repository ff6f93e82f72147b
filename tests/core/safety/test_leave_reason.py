"""Why the service ends stands in the reason of the state, if it is no operator's wish."""

from machines import compact

from motionserver.core.safety.record import GuardRecord
from motionserver.core.safety.states import Event
from motionserver.core.safety.supervisor import Supervisor
from motionserver.core.safety.watchdog import Patience


def test_a_lost_run_directory_is_the_reason_of_parking() -> None:
    supervisor = Supervisor(compact(), Patience(), 1 / 60, 1 / 60)
    assert supervisor.why(GuardRecord(), Event.PARK, 0) == "park was asked for"
    supervisor.leave_reason = "the run directory /x was removed"
    told = supervisor.why(GuardRecord(), Event.PARK, 0)
    assert told == "the service is ending: the run directory /x was removed"
    assert supervisor.why(GuardRecord(), Event.TRACKING_ERROR, 0) != told
