"""One profile of hypothesis for all: the same examples in every run, no deadline."""

from hypothesis import settings

# the machines are shared: how long an example takes says nothing, and a test must not be lucky
settings.register_profile("house", deadline=None, derandomize=True)
settings.load_profile("house")
