"""What the page's process is told at start; checked before anything is bound."""

from __future__ import annotations

import ipaddress
import json
import ssl
import stat
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, Literal, cast

from motionserver.bounded_files import SETTINGS_BYTES, check_regular
from motionserver.core.limits import Machine, machine_from_mapping
from motionserver.errors import MotionServerError

LOOPBACK_NAMES: Final = frozenset({"localhost", "127.0.0.1", "[::1]"})


class WebConfigError(MotionServerError):
    """The page cannot be served like this; the text says what to change."""


@dataclass(frozen=True, slots=True)
class WebConfig:
    """Configuration of the page's process.

    Attributes:
        host: Address to bind; anything but loopback needs TLS.
        port: TCP port.
        tokens_file: JSON of three tokens, made at first start (mode 0600).
        run_dir: Where the mapped files and request sockets of the others are.
        audit_file: Where it is written down who changed what; outlives a run.
        presets_dir: Where the user's presets are kept.
        machine: `machine_to_mapping` of the machine in use.
        allowed_hosts: Names this server may be asked under, beside its own address.
        engage: "local" = never by HTTP; "http" = by HTTP where `engage_refusal` agrees.
        enable_input: True if an enable input is configured; the guard reads it at each engage.
        tls_cert: Certificate chain, PEM.
        tls_key: Its key, PEM.
        blackbox_dir: Where the dumps of the black box lie; None without one.
    """

    host: str
    port: int
    tokens_file: Path
    run_dir: Path
    audit_file: Path
    presets_dir: Path
    machine: Mapping[str, Any]
    allowed_hosts: tuple[str, ...] = ()
    engage: Literal["local", "http"] = "local"
    enable_input: bool = False
    tls_cert: Path | None = None
    tls_key: Path | None = None
    blackbox_dir: Path | None = None
    _machine: list[Machine] = field(default_factory=list, repr=False, compare=False)

    @property
    def is_loopback(self) -> bool:
        """Whether only this computer can reach the page."""
        return is_loopback(self.host) or self.host == "localhost"

    @property
    def host_names(self) -> frozenset[str]:
        """Host names (no port) a request may carry."""
        own = f"[{self.host}]" if ":" in self.host else self.host.lower()
        names = {own, *(name.lower() for name in self.allowed_hosts)}
        return frozenset(names | LOOPBACK_NAMES if self.is_loopback else names)

    def hexapod(self) -> Machine:
        """The machine, rebuilt once."""
        if not self._machine:
            self._machine.append(machine_from_mapping(dict(self.machine)))
        return self._machine[0]

    def engage_refusal(self) -> str | None:
        """Why engaging by HTTP is not possible here; None if it is."""
        if self.engage != "http":
            return "the configuration does not allow it ([operator] engage is not http)"
        if not (self.is_loopback or self.enable_input):
            return "engaging from another computer needs a configured enable input"
        return None

    def check(self) -> None:
        """Refuse what must not be bound.

        Raises:
            WebConfigError: Reachable from outside without certificate, key and tokens.
        """
        if not 0 <= self.port <= 65535:
            raise WebConfigError(f"port = {self.port}: allowed 0 to 65535")
        if (self.tls_cert is None) != (self.tls_key is None):
            raise WebConfigError("tls_cert and tls_key: give both or none")
        for name in ("tls_cert", "tls_key"):
            path = getattr(self, name)
            if path is None:
                continue
            if not path.exists():
                raise WebConfigError(f"{name} = {path}: no such file")
            try:
                check_regular(path, SETTINGS_BYTES)
            except OSError as error:
                raise WebConfigError(f"{name} = {path}: {error.strerror}") from error
        for name in ("tokens_file", "audit_file"):
            path = getattr(self, name)
            if path.exists() and not path.is_file():
                raise WebConfigError(f"{name} = {path}: is not a regular file; name another")
        if self.tls_key is not None and (mode := stat.S_IMODE(self.tls_key.stat().st_mode)) & 0o007:
            raise WebConfigError(
                f"tls_key = {self.tls_key}: mode {mode:04o} lets every user of this computer read "
                f"it; do: chmod o-rwx {self.tls_key}"
            )
        if self.is_loopback:
            return
        if self.tls_cert is None or not self.tokens_file.is_file():
            raise WebConfigError(
                f"host = {self.host}: other computers could reach the page, which needs tls_cert, "
                f"tls_key and an existing tokens file ({self.tokens_file}). Start once on "
                "127.0.0.1 to make the tokens, name a certificate and key, or stay on 127.0.0.1"
            )

    def check_certificate(self) -> None:
        """Refuse a certificate and key that cannot be served, before the page's process tries.

        Raises:
            WebConfigError: They cannot be read, are no PEM, are encrypted, or do not belong
                together.
        """
        if self.tls_cert is None:
            return
        context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
        try:
            context.load_cert_chain(self.tls_cert, self.tls_key, password=lambda: "")
        except (OSError, ValueError) as error:
            raise WebConfigError(
                f"tls_cert = {self.tls_cert}, tls_key = {self.tls_key}: not a certificate chain "
                f"and its own unencrypted key, PEM ({getattr(error, 'reason', None) or error})"
            ) from error


def is_loopback(address: str) -> bool:
    """Whether an IP address is this computer's own."""
    try:
        ip = ipaddress.ip_address(address)
    except ValueError:
        return False
    mapped = ip.ipv4_mapped if isinstance(ip, ipaddress.IPv6Address) else None
    return (mapped or ip).is_loopback


def config_from(data: Mapping[str, Any]) -> WebConfig:
    """The configuration from what the settings resolved it to.

    Raises:
        TypeError: A key is missing or unknown.
    """
    values = dict(data)
    for name in ("tokens_file", "run_dir", "audit_file", "presets_dir", "tls_cert", "tls_key",
                 "blackbox_dir"):  # fmt: skip
        if values.get(name) is not None:
            values[name] = Path(values[name])
    values["allowed_hosts"] = tuple(values.get("allowed_hosts", ()))
    return WebConfig(**values)


def read_config(path: Path) -> WebConfig:
    """Read the JSON file written by whoever starts this process.

    Raises:
        WebConfigError: Not readable, or a key is missing or unknown.
    """
    try:
        return config_from(cast("dict[str, Any]", json.loads(path.read_text(encoding="utf-8"))))
    except (OSError, ValueError, TypeError, AttributeError) as error:
        raise WebConfigError(f"{path}: {error}") from error
