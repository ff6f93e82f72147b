"""Settings: the only place that reads TOML and turns other units into SI."""
