"""Reading `host:port`."""

from __future__ import annotations


def parse_address(address: str, default_port: int) -> tuple[str, int]:
    """Split `host`, `host:port`, `[ipv6]` or `[ipv6]:port`.

    Raises:
        ValueError: The address has another form, or the port is not 1 to 65535.
    """
    host, colon, port = address.rpartition(":")
    if not colon or address.endswith("]"):
        host, port = address, str(default_port)
    if host.startswith("[") and host.endswith("]"):
        host = host[1:-1]
    elif ":" in host:
        host = ""
    if not host or not port.isdecimal() or not 1 <= int(port) <= 65535:
        raise ValueError(
            f"address {address!r} is not host, host:port or [ipv6]:port with a port of "
            f"1 to 65535; write for example 127.0.0.1:{default_port}"
        )
    return host, int(port)
