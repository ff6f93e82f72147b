"""Genuine drives: fetch public recordings of real vehicles, check their axes, convert them."""
