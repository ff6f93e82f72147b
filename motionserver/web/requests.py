"""Requests to guard and planner, and what their answers mean in HTTP."""

from __future__ import annotations

import asyncio
from concurrent.futures import ThreadPoolExecutor
from typing import Any, Final, Protocol

from motionserver.web.refusal import Refusal

_STATUS: Final = {"stale": 412, "invalid": 422, "rate": 429, "nothing": 409}
_DO: Final = {
    "stale": "read GET /api/tuning again and repeat with its ETag",
    "invalid": "correct the values named in details",
    "rate": "wait a second and repeat",
    "nothing": "-",
}
_ALLOWED: Final = {
    "stale": 'If-Match with the version in force, "{version}"',
    "invalid": "see details",
    "rate": "two changes a second",
}


class Ask(Protocol):
    """Sends one request to a process and waits for the answer (blocking)."""

    def __call__(self, request: dict[str, Any]) -> dict[str, Any]:
        """Ask.

        Raises:
            OSError: It does not answer (TimeoutError) or is not there.
        """
        ...


class Peer:
    """One of the two processes that take requests.

    Args:
        name: "guard" or "planner", for errors.
        ask: How it is asked.
    """

    def __init__(self, name: str, ask: Ask) -> None:
        self._name = name
        self._ask = ask
        # its own threads: to park, nobody waits behind questions to a planner that hangs
        self._threads = ThreadPoolExecutor(4, thread_name_prefix=f"ask-{name}")

    async def ask(self, request: dict[str, Any], path: str) -> dict[str, Any]:
        """Ask without holding up the other readers.

        Raises:
            Refusal: No answer (503).
        """
        try:
            loop = asyncio.get_running_loop()
            answer = await loop.run_in_executor(self._threads, self._ask, request)
        except (OSError, ValueError) as error:
            raise Refusal(
                503,
                f"the {self._name} does not answer ({type(error).__name__})",
                path,
                f"a running {self._name}",
                "look at processes in /api/status; it is restarted by itself if it died",
                headers={"retry-after": "1"},
            ) from error
        return answer


def tuning_refusal(answer: dict[str, Any], path: str) -> Refusal:
    """The planner's no to a change."""
    kind = str(answer.get("kind"))
    more = {key: answer[key] for key in ("details", "version") if key in answer}
    allowed = _ALLOWED.get(kind, "").format(version=answer.get("version", "?"))
    headers = {"retry-after": "1"} if kind == "rate" else {}
    status = _STATUS.get(kind, 409)
    error = str(answer.get("error", "refused"))
    return Refusal(status, error, path, allowed, _DO.get(kind, ""), headers=headers, **more)


def guard_refusal(answer: dict[str, Any], path: str) -> Refusal:
    """The guard's no to engage, park or reset."""
    reason = str(answer.get("reason", "refused"))
    return Refusal(
        409,
        reason,
        path,
        "engage in PARKED with a live source; reset in FAULT or SAFE once the cause is gone",
        "look at state and reason, remove the cause, ask again",
        state=answer.get("state"),
        reason=reason,
    )
