"""The reachable workspace of a machine: ranges, sections, corners, shares, a table, a page."""
