"""`python -m motionserver.web <configuration.json>`."""

import sys

from motionserver.web.main import main

sys.exit(main(sys.argv[1:]))
