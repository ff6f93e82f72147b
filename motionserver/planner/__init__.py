"""The planner process: sources, cueing, proposals."""
