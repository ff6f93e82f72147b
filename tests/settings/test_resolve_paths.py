import pytest

from motionserver.errors import ConfigError
from motionserver.settings.config import load_config
from motionserver.settings.resolve import resolve


def test_a_file_whose_name_no_disk_holds_is_told(tmp_path):
    source = {"kind": "zenoh", "zenoh_config": "a" * 300}
    with pytest.raises(ConfigError, match="no such file"):
        resolve(load_config(None, {"sources": [source]}), tmp_path)
