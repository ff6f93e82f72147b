"""The guard process: sole owner of the platform."""
