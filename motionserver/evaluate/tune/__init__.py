"""Search of tunables on recordings, with a report that says why and what it is worth."""
