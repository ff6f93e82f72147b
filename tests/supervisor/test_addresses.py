"""One platform has one server: the claim on it."""

import os
import subprocess
import sys

import pytest

from motionserver.errors import ConfigError
from motionserver.supervisor.addresses import claim_platform


def test_a_platform_is_claimed_once_until_it_is_let_go() -> None:
    with claim_platform("127.0.0.1", 4991):
        with pytest.raises(ConfigError, match=r"another server .* drives 127\.0\.0\.1:4991"):
            claim_platform("127.0.0.1", 4991)
        claim_platform("127.0.0.1", 4992).close()
        claim_platform("127.0.0.2", 4991).close()
    claim_platform("127.0.0.1", 4991).close()


def test_who_inherits_the_claim_holds_it() -> None:
    claim = claim_platform("127.0.0.1", 4993)
    code = "import sys; sys.stdin.read()"
    heir = subprocess.Popen(
        [sys.executable, "-S", "-c", code], stdin=subprocess.PIPE, pass_fds=(claim.fileno(),)
    )
    claim.close()
    with pytest.raises(ConfigError):
        claim_platform("127.0.0.1", 4993)
    heir.communicate(b"", 30.0)
    claim_platform("127.0.0.1", 4993).close()
    assert os.getpid() != heir.pid
