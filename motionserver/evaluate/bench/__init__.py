"""Benchmarks: lateness, plan times and latency, each beside a sentinel that only sleeps."""
