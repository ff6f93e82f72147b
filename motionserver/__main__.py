"""``python -m motionserver``."""

from motionserver.cli import main

main()
