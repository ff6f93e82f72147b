"""Quadratic-programme backends behind one interface."""
