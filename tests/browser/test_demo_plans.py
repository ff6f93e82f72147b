"""The demo with its page open in a browser: how many plans are refused after the first seconds.

    pytest -m campaign -s tests/browser/test_demo_plans.py

prints the figures; run it alone, since everything else on the machine is measured with it.
"""

import json
import os
import re
import subprocess
import sys
import time
import urllib.request

import pytest
from browser.chromium import IN_CHROMIUM

pytestmark = [*IN_CHROMIUM, pytest.mark.campaign, pytest.mark.timeout(400)]
SETTLE = 5.0
"""The first seconds of the drive, in which the planner learns how long its plans take [s]."""
MEASURED = 30.0
COUNTED = ("plans_accepted", "plans_rejected")


def status(page):
    with urllib.request.urlopen(f"{page}/api/status", timeout=10.0) as answer:
        return json.load(answer)


def counted(found):
    """Verdicts by kind, and when."""
    counters = found["guard"]["counters"]
    reasons = {name for name in counters if name.startswith("rejected_")}
    return {name: counters.get(name, 0) for name in (*COUNTED, *reasons)}


def until_running(page):
    deadline = time.monotonic() + 120.0
    while time.monotonic() < deadline:
        found = status(page)
        if found["state"] == "RUN":
            return
        time.sleep(0.2)
    raise AssertionError(f"the demo does not run: {found['state']}")


@pytest.mark.parametrize("algorithm", ["mpc", "classical"])
def test_few_plans_are_refused_while_the_page_is_open(chromium, algorithm):
    command = [sys.executable, "-m", "motionserver", "demo", "--algorithm", algorithm]
    with subprocess.Popen(
        [*command, "--seconds", "120"], stdout=subprocess.PIPE, text=True, bufsize=1
    ) as demo:
        try:
            page = next(
                found[1]
                for line in demo.stdout
                if (found := re.search(r"page\s+(http://[^\s/]+)", line)) is not None
            )
            context = chromium.new_context(viewport={"width": 1400, "height": 900})
            tab = context.new_page()
            deadline = time.monotonic() + 60.0
            while time.monotonic() < deadline:
                try:
                    tab.goto(page)
                    break
                except Exception:
                    time.sleep(0.5)
            until_running(page)
            time.sleep(SETTLE)
            before = counted(status(page))
            time.sleep(MEASURED)
            after_all = status(page)
            after = counted(after_all)
            context.close()
        finally:
            demo.terminate()
            # the platform comes down first
            demo.communicate(timeout=90.0)
    found = {name: count - before.get(name, 0) for name, count in after.items()}
    plans = sum(found[name] for name in COUNTED)
    refused = found["plans_rejected"] / max(plans, 1)
    solver, handover = after_all["planner"]["solver"], after_all["planner"].get("handover")
    print(
        f"\n{algorithm}: refused {100 * refused:.2f} % of {plans} plans in {MEASURED:g} s "
        f"({ {name: count for name, count in found.items() if count} }); plan p50 "
        f"{solver['time_p50_ms']:.1f}, p99 {solver['time_p99_ms']:.1f} ms; {handover}; load "
        f"{os.getloadavg()[0]:.1f} on {os.cpu_count()} cores"
    )
    assert plans > 0.8 * 60.0 * MEASURED
    assert refused < 0.02
