"""The black box: the last minute of everything, in memory, written to disk on every fault."""
