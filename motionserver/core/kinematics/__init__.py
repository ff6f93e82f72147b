"""Hexapod geometry: leg lengths from poses and back."""
