"""Published results, redrawn by the server's own code."""

from motionserver.evaluate.reproduce.command import reproduce

__all__ = ["reproduce"]
