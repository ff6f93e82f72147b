"""`python -m motionserver.web <configuration.json>`."""

import signal
import sys

from motionserver.telemetry.signals import ignore_signals, let_through
from motionserver.web.main import main

ignore_signals(but=(signal.SIGTERM,))
let_through()
sys.exit(main(sys.argv[1:]))
