"""Print the model: ``python -m motionserver.evaluate.proof > states.pml``."""

import sys

from motionserver.evaluate.proof.promela import promela

if __name__ == "__main__":
    sys.stdout.write(promela())
