"""Mapped files, requests, measurements."""
