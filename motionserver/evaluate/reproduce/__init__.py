"""Published results, redrawn by the server's own code."""
