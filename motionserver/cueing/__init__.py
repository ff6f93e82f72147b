"""Cueing algorithms: specific force wanted in, plans out."""
