"""Shipped machines and tunings."""
