"""What holds for all tests: no example is judged by how long it took on a busy machine."""

import os

from hypothesis import settings

# more threads in the many small products of a period cost several times what they gain
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

settings.register_profile("house", deadline=None, derandomize=True)
settings.load_profile("house")
