"""Run targets: a campaign of mutated packets, atheris, or one file again. See README.md here."""

import argparse
import hashlib
import logging
import os
import sys
import time
import traceback
import warnings
from pathlib import Path

HERE = Path(__file__).parent
ROOT = HERE.parent.parent
for one in (ROOT, ROOT / "protocol", ROOT / "clients", ROOT / "tests", HERE):
    sys.path.insert(0, str(one))
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
BATCH = 50_000
WATCHED = [
    "motion_protocol",
    "motion_clients.moog_wire",
    "motion_clients.moog_device",
    "motion_clients.moog_machine",
    "motionserver.core.intake",
    "motionserver.core.plan",
    "motionserver.core.safety.will",
    "motionserver.platforms",
    "motionserver.planner.inputs",
    "motionserver.settings",
    "motionserver.sources",
    "motionserver.telemetry.link",
    "motionserver.telemetry.mapped",
    "motionserver.telemetry.requests",
    "tomllib",
]
"""What atheris looks into."""


def campaign(names, packets, seed, found_dir, log):
    """Mutated packets of all targets; whatever breaks an invariant is kept. Number of those."""
    from mutate import Mutator
    from targets import TARGETS

    quiet()
    total = sum(TARGETS[name].share for name in names)
    begin, worked, sent, broken = time.monotonic(), time.process_time(), 0, 0
    for name in names:
        target = TARGETS[name]
        seeds = [data for _, data in target.corpus()]
        count = round(packets * target.share / total)
        started, taken, bad = time.process_time(), 0, 0
        for block, start in enumerate(range(0, count, BATCH)):
            mutator = Mutator(target.shape, seeds, f"{name} {seed} {block}")
            for _ in range(min(BATCH, count - start)):
                packet = mutator.draw()
                try:
                    taken += target.check(packet)
                except Exception as error:
                    bad += 1
                    keep(target.name, packet, error, found_dir, bad)
        spent = time.process_time() - started
        sent, broken = sent + count, broken + bad
        share = 100 * taken / max(count, 1)
        line = f"{name:14} {count:9} packets {share:5.1f} % taken {bad:6} broken"
        tell(log, f"{line} {1e6 * spent / max(count, 1):7.1f} us each {spent:7.1f} s")
    spent, worked = time.monotonic() - begin, time.process_time() - worked
    line = f"{'all':14} {sent:9} packets, {broken} broken, seed {seed}"
    tell(log, f"{line}, {worked:.1f} s of a processor in {spent:.1f} s")
    return broken


def quiet():
    """Warnings are failures; the planner's own words about refused packets are not wanted."""
    warnings.simplefilter("error")
    logging.disable()


def tell(log, line):
    line = f"{time.strftime('%H:%M:%S', time.gmtime())} {line}"
    sys.stdout.write(line + "\n")
    sys.stdout.flush()
    if log is not None:
        with log.open("a") as file:
            file.write(line + "\n")


def keep(name, packet, error, folder, bad):
    """Keep what broke an invariant; tell the first few."""
    if bad > 20:
        return
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{name}-{hashlib.sha256(packet).hexdigest()[:12]}"
    path.write_bytes(packet)
    if bad <= 5:
        text = "".join(traceback.format_exception(error, limit=-3))
        sys.stderr.write(f"{path}\n{text}\n")


def guided(name, seconds, folder, extra):
    """Let atheris search; new inputs gather in ``folder``."""
    import atheris

    with atheris.instrument_imports(include=WATCHED):
        from mutate import Mutator
        from targets import TARGETS
    quiet()
    target = TARGETS[name]
    folder.mkdir(parents=True, exist_ok=True)
    for label, data in target.corpus():
        (folder / label).write_bytes(data)
    seeds = [data for _, data in target.corpus()]
    arguments = [sys.argv[0], str(folder), f"-max_total_time={seconds}", *extra]
    arguments += [f"-artifact_prefix={folder.parent}/{name}-"]
    arguments += [f"-max_len={64 + max(map(len, seeds))}"]
    mutator = Mutator(target.shape, seeds, name)

    def once(data):
        target.check(data)

    def change(data, longest, seed):
        # what atheris sees in comparisons, and what only the shape of the format can mend
        mutator.rng.seed(seed)
        if mutator.rng.random() < 0.4:
            return atheris.Mutate(data, longest)
        return mutator.change(data, mutator.rng.randrange(1, 4))[:longest]

    atheris.Setup(arguments, once, custom_mutator=change)
    atheris.Fuzz()


def again(name, path):
    """Check one file."""
    from targets import TARGETS

    quiet()
    taken = TARGETS[name].check(path.read_bytes())
    sys.stdout.write(f"{path}: {'taken' if taken else 'refused'}\n")


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    ways = parser.add_subparsers(dest="way", required=True)
    way = ways.add_parser("campaign")
    way.add_argument("--packets", type=int, default=10_000_000)
    way.add_argument("--seed", default="1")
    way.add_argument("--log", type=Path)
    way.add_argument("--found", type=Path, default=Path("fuzz-found"))
    way.add_argument("targets", nargs="*")
    way = ways.add_parser("atheris")
    way.add_argument("target")
    way.add_argument("--seconds", type=int, default=120)
    way.add_argument("--folder", type=Path, required=True)
    way.add_argument("extra", nargs="*")
    way = ways.add_parser("again")
    way.add_argument("target")
    way.add_argument("file", type=Path)
    given = parser.parse_args()
    if given.way == "campaign":
        from targets import TARGETS

        names = given.targets or list(TARGETS)
        return bool(campaign(names, given.packets, given.seed, given.found, given.log))
    if given.way == "atheris":
        guided(given.target, given.seconds, given.folder, given.extra)
    else:
        again(given.target, given.file)
    return 0


if __name__ == "__main__":
    sys.exit(main())
