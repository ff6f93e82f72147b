"""Motion-cueing server: from a driving simulator's accelerations to a hexapod's legs."""

__version__ = "0.1.0"
