"""Start of the page's process: nice, bounded, and refused where it would be open to strangers."""

from __future__ import annotations

import os
import signal
import sys
from pathlib import Path
from types import FrameType

import uvicorn
from fastapi import FastAPI

from motionserver.telemetry.log_output import start_log
from motionserver.telemetry.oom import HELPER, set_oom_score
from motionserver.telemetry.parent import follow_parent
from motionserver.telemetry.run_files import located
from motionserver.web.config import WebConfig, WebConfigError, read_config
from motionserver.web.connection import PatientLoop, PatientProtocol
from motionserver.web.wiring import wired_app

_NICENESS = 10
_BACKLOG = 32


class PageServer(uvicorn.Server):
    """Ends by SIGTERM alone: Ctrl-C is the service's, which parks first."""

    def handle_exit(self, sig: int, frame: FrameType | None) -> None:
        """Take the service's signal, and no other."""
        if sig == signal.SIGTERM:
            super().handle_exit(sig, frame)


def server(app: FastAPI, config: WebConfig) -> uvicorn.Server:
    """The HTTP server, with every limit that keeps a flood from costing more than its answers."""
    return PageServer(
        uvicorn.Config(
            app,
            host=config.host,
            port=config.port,
            ssl_certfile=config.tls_cert,
            ssl_keyfile=config.tls_key,
            http=PatientProtocol,
            ws="none",
            lifespan="on",
            loop=f"{PatientLoop.__module__}:{PatientLoop.__name__}",
            # asyncio tries and reports as many accepts in a row when descriptors run out
            backlog=_BACKLOG,
            timeout_keep_alive=5,
            timeout_graceful_shutdown=1,
            h11_max_incomplete_event_size=16 * 1024,
            proxy_headers=False,
            server_header=False,
            access_log=False,
            log_config=None,  # our own output, which nobody waits for
            log_level="error",  # a stranger must not be able to fill the log
        )
    )


def main(arguments: list[str]) -> int:
    """Serve the page until a signal ends it.

    Args:
        arguments: One path, the JSON file of the configuration.

    Returns:
        Exit status: 0 ended by signal, 2 refused to start.
    """
    if len(arguments) != 1:
        sys.stderr.write("usage: python -m motionserver.web <configuration.json>\n")
        return 2
    try:
        path = Path(arguments[0])
        config = read_config(located(path.parent, path.name))
        config.check()
        app = wired_app(config)
    except WebConfigError as error:
        sys.stderr.write(f"page not started: {error}\n")
        return 2
    follow_parent()
    start_log()
    os.nice(_NICENESS)
    set_oom_score(HELPER)
    server(app, config).run()
    return 0
