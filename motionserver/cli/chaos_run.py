"""chaos: runs the proxy until a signal or its time is over, shows and counts."""

from __future__ import annotations

import asyncio
import errno
import json
import os
import selectors
import signal
import sys
from dataclasses import asdict
from pathlib import Path
from typing import Any

import typer
from motion_clients.fault_proxy import MOST_SESSIONS, FaultProxy
from motion_clients.flawed_link import LinkFlaws

from motionserver.cli.chaos_options import ChaosOptions
from motionserver.errors import ConfigError

SHOW_EVERY = 1.0
_OURS = (errno.EADDRINUSE, errno.EADDRNOTAVAIL, errno.EACCES)


def run_chaos(options: ChaosOptions) -> dict[str, Any]:
    """Be a bad network until SIGINT, SIGTERM or the end of its time.

    Not punctual by real-time priority, as the other ends of the wire are: flooded, it would keep
    the guard from its processor, and the flaw would be ours.

    Returns:
        What was counted, as written to ``json_out``.

    Raises:
        ConfigError: An option is wrong, an address not free, or the file cannot be written.
    """
    flaws, duration = options.flaws(), options.duration()
    listen, to = options.ends()
    proxy = FaultProxy(
        listen,
        to,
        there=flaws,
        back=flaws if options.are_replies_flawed else LinkFlaws(),
        seed=options.seed,
    )
    with asyncio.Runner(loop_factory=_exact_loop) as runner:
        counted = runner.run(_serve(proxy, options, duration))
    typer.echo(summary_text(counted))
    return counted


def _exact_loop() -> asyncio.AbstractEventLoop:
    """A loop whose timers are not rounded up to milliseconds, as epoll's are."""
    return asyncio.SelectorEventLoop(selectors.SelectSelector())


async def _serve(proxy: FaultProxy, options: ChaosOptions, duration: float) -> dict[str, Any]:
    over = asyncio.Event()
    loop = asyncio.get_running_loop()
    for number in (signal.SIGINT, signal.SIGTERM):
        loop.add_signal_handler(number, over.set)
    try:
        await proxy.__aenter__()
    except OSError as error:
        blamed = ("--listen", options.listen) if error.errno in _OURS else ("--to", options.to)
        raise ConfigError(blamed[0], f"{blamed[1]}: {error.strerror}", "Choose another.") from error
    try:
        _write(options.json_out, summary(proxy, options))
        host, port = proxy.address
        typer.echo(
            f"{host}:{port} -> {options.to}: {options.in_words()}; seed {options.seed}; replies "
            + ("meet the same flaws" if options.are_replies_flawed else "pass unharmed")
        )
        await _wait(proxy, over, duration)
        counted = summary(proxy, options)
    finally:
        await proxy.__aexit__(None, None, None)
    _write(options.json_out, counted)
    return counted


async def _wait(proxy: FaultProxy, over: asyncio.Event, duration: float) -> None:
    """Wait for the end, and tell a terminal of every second."""
    before, instant = summary_ways(proxy), 0.0
    while not over.is_set() and instant < duration:
        instant = min(instant + SHOW_EVERY, duration)
        try:
            await asyncio.wait_for(over.wait(), max(0.0, instant - proxy.now))
        except TimeoutError:
            if sys.stdout.isatty():
                ways = summary_ways(proxy)
                typer.echo(second_text(instant, before, ways))
                before = ways


def summary_ways(proxy: FaultProxy) -> dict[str, dict[str, int]]:
    """Counters of both ways."""
    waiting = proxy.waiting
    return {
        "there": {**asdict(proxy.there), "waiting": waiting["there"]},
        "back": {**asdict(proxy.back), "waiting": waiting["back"]},
    }


def summary(proxy: FaultProxy, options: ChaosOptions) -> dict[str, Any]:
    """What was counted, JSON-able."""
    host, port = proxy.address
    return {
        "listen": f"{host}:{port}",
        "to": options.to,
        "seed": options.seed,
        "flaws": options.flaws_shown(),
        "replies_flawed": options.are_replies_flawed,
        "seconds": proxy.now,
        "sessions": proxy.opened,
        "peers": proxy.peers,
        "refused": proxy.refused,
        "unreachable": proxy.unreachable,
        **summary_ways(proxy),
    }


def second_text(
    instant: float, before: dict[str, dict[str, int]], now: dict[str, dict[str, int]]
) -> str:
    """One second in a line."""
    told = []
    for way in ("there", "back"):
        passed = {name: count - before[way][name] for name, count in now[way].items()}
        lost = passed["lost"] + passed["dropped"] + passed["unsent"]
        told.append(
            f"{way} {passed['sent']:5d} through {lost:4d} lost {passed['changed']:4d} changed"
        )
    return f"{instant:6.0f} s  " + "   ".join(told)


def summary_text(counted: dict[str, Any]) -> str:
    """All of it in words."""
    lines = []
    for way in ("there", "back"):
        c = counted[way]
        lines.append(
            f"{way:<6} {c['received']} packets came, {c['sent']} went on; "
            f"{c['lost']} lost ({c['silenced']} in silence), {c['duplicated']} doubled, "
            f"{c['reordered']} held back, {c['changed']} changed ({c['corrupted']} corrupted, "
            f"{c['truncated']} truncated)"
        )
        for name, meaning in (
            ("waiting", "still on their way"),
            ("dropped", "dropped, for no room was left: less delay, or fewer packets"),
            ("unsent", "refused by the network"),
        ):
            if c[name]:
                lines.append(f"{way:<6} {c[name]} {meaning}")
    if counted["unreachable"]:
        lines.append(f"nobody listened at {counted['to']}, told {counted['unreachable']} times")
    if counted["refused"]:
        lines.append(
            f"{counted['refused']} packets of further senders refused: at most {MOST_SESSIONS}"
        )
    senders = "sender" if counted["sessions"] == 1 else "senders"
    lines.append(f"{counted['sessions']} {senders} in {counted['seconds']:.1f} s")
    return "\n".join(lines)


def _write(path: Path | None, counted: dict[str, Any]) -> None:
    """Write the counters; done at the start already, so that a mistake shows then."""
    if path is None:
        return
    try:
        path.write_text(json.dumps(counted, indent=2) + os.linesep, encoding="utf-8")
    except OSError as error:
        raise ConfigError("--json", f"{path}: {error.strerror}", "Choose another.") from error
