"""Offline evaluation: the live code in lock-step."""
