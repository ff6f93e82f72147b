"""Runs, for every mutant, the tests that pass its lines, until one of them fails.

A change inside a function is tried in a fork of a process that has collected and once run all
tests: the function's code is exchanged in place. A change outside functions is tried in a fork of
a process that has imported other people's packages only: everything of ours is imported anew.
"""

import gc
import importlib
import json
import os
import sys
import time
from collections import Counter, defaultdict
from contextlib import redirect_stdout
from importlib.machinery import ModuleSpec, SourceFileLoader
from importlib.util import spec_from_file_location
from inspect import getattr_static
from pathlib import Path

import coverage
import hypothesis
import pytest
from mutation.children import each, limit_processor
from mutation.mutants import Mutant

# in this very process: workers of their own would run tests without the exchanged code
OPTIONS = ["-q", "-s", "-n", "0", "--timeout=0", "-p", "no:cacheprovider", "-W",
           "ignore::pytest.PytestAssertRewriteWarning"]  # fmt: skip
PATIENCE = 1800.0
NEVER = "no test passes here"
HEAVY = ("numpy", "scipy.signal", "scipy.linalg", "scipy.optimize", "scipy.spatial", "pydantic",
         "pydantic_settings", "fastapi", "typer", "zenoh", "osqp", "daqp", "piqp")  # fmt: skip


class _Judge:
    """Remembers the first test that failed."""

    def __init__(self) -> None:
        self.failed = ""

    def pytest_runtest_logreport(self, report) -> None:
        if report.failed and not self.failed:
            self.failed = report.nodeid


def _quick() -> None:
    """One counterexample is enough; it need not be a small one."""
    phases = (hypothesis.Phase.explicit, hypothesis.Phase.generate)
    hypothesis.settings.register_profile(
        "mutation", hypothesis.settings(), phases=phases, database=None, print_blob=False,
        report_multiple_bugs=False,
    )  # fmt: skip
    hypothesis.settings.load_profile("mutation")


class Collected:
    """Takes the place of pytest's own loop: first all tests as they are, then the mutants."""

    def __init__(self, root: Path, mutants: list[Mutant], workers: int, out: Path) -> None:
        self.root, self.workers, self.out = root, workers, out
        self.mutants = mutants
        self.kills: defaultdict[str, Counter[str]] = defaultdict(Counter)

    @pytest.hookimpl(tryfirst=True)
    def pytest_collection(self) -> None:
        _quick()

    def pytest_runtestloop(self, session) -> bool:
        if session.testsfailed:
            pytest.exit("the tests cannot be collected", 2)
        self.items = {item.nodeid: item for item in session.items}
        self._look()
        with self.out.open("w") as out:
            print(json.dumps([self.seconds, self.passed]), file=out)
            gc.collect()
            gc.freeze()
            for _, said in each([None], self._control, 1, PATIENCE):
                if said != "survived":
                    pytest.exit(f"fails a second time without any change: {said}", 2)
            inner = [mutant for mutant in self.mutants if mutant.function]
            for mutant, said in each(inner, self._try, self.workers, PATIENCE):
                self.kills[mutant.function][said] += 1
                print(json.dumps([mutant.name, said]), file=out, flush=True)
        return True

    def _look(self) -> None:
        """Run every test once: how long it takes, which lines it passes."""
        files = sorted({str(self.root / mutant.file) for mutant in self.mutants})
        watch = coverage.Coverage(data_file=None, include=files, config_file=False)
        # a file of nothing but declarations has no line that a test passes
        watch.set_option("run:disable_warnings", ["no-data-collected"])
        self.seconds: dict[str, float] = {}
        watch.start()
        for name, item in self.items.items():
            watch.switch_context(name)
            began = time.process_time()
            failed = _run([item])
            self.seconds[name] = time.process_time() - began
            if failed:
                pytest.exit(f"fails as it is: {failed}", 2)
        watch.stop()
        data = watch.get_data()
        self.passed: dict[str, dict[int, list[str]]] = {
            os.path.relpath(file, self.root): data.contexts_by_lineno(file) for file in files
        }

    def _control(self, _: None) -> str:
        order = sorted(self.seconds, key=lambda name: self.seconds[name])
        return self._first_failure(order)

    def _first_failure(self, order: list[str]) -> str:
        for name in order:
            limit_processor(3.0 + 5.0 * self.seconds[name])
            if failed := _run([self.items[name]]):
                return failed
        return "survived" if order else NEVER

    def _try(self, mutant: Mutant) -> str:
        passed = self.passed[mutant.file]
        first, last = mutant.lines
        names = {name for line in range(first, last + 1) for name in passed.get(line, ()) if name}
        kills = self.kills[mutant.function]
        order = sorted(
            names, key=lambda name: (-kills[name], not _is_near(name, mutant), self.seconds[name])
        )
        _exchange(mutant)
        return self._first_failure(order)


def _is_near(name: str, mutant: Mutant) -> bool:
    """True of the tests that bear the name of the mutated file."""
    return Path(name.split("::")[0]).name.startswith(f"test_{Path(mutant.file).stem}")


def _run(items: list[pytest.Item]) -> str:
    judge = _Judge()
    manager = items[0].config.pluginmanager
    manager.register(judge)
    for item, after in zip(items, [*items[1:], None], strict=True):
        item.config.hook.pytest_runtest_protocol(item=item, nextitem=after)
        if judge.failed:
            break
    manager.unregister(judge)
    return judge.failed


def _exchange(mutant: Mutant) -> None:
    """Give the living function the mutant's code."""
    module = sys.modules[module_name(mutant.file)]
    owner: object = module
    for part in mutant.function.split("."):
        owner = getattr_static(owner, part)
    while not hasattr(owner, "__code__"):
        owner = getattr(owner, "fget", None) or owner.__wrapped__  # type: ignore[attr-defined]
    owner.__code__ = _find(mutant.code, owner.__code__.co_qualname)  # type: ignore[attr-defined]


def _find(code, name: str):
    for const in code.co_consts:
        if hasattr(const, "co_qualname"):
            if const.co_qualname == name:
                return const
            if name.startswith(const.co_qualname + "."):
                return _find(const, name)
    raise LookupError(name)


def module_name(file: str) -> str:
    """The name a source file is imported by."""
    parts = Path(file).with_suffix("").parts
    parts = parts[1:] if parts[0] == "protocol" else parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def preload() -> None:
    """Import what is heavy and not ours, pytest's plugins too."""
    for name in HEAVY:
        importlib.import_module(name)
    with open(os.devnull, "w") as nothing, redirect_stdout(nothing):
        pytest.main([*OPTIONS, "--collect-only", "--ignore-glob=*", "tests/mutation"])


class Mutated(SourceFileLoader):
    """Finds and loads one module with its mutant's code."""

    def __init__(self, root: Path, mutant: Mutant) -> None:
        super().__init__(module_name(mutant.file), str(root / mutant.file))
        self.mutant = mutant

    def find_spec(self, name: str, path: object = None, target: object = None) -> ModuleSpec | None:
        return spec_from_file_location(name, self.path, loader=self) if name == self.name else None

    def get_code(self, fullname: str) -> object:
        return self.mutant.code


class Anew:
    """In a process that has nothing of ours: the chosen tests, quickest first, till one fails."""

    def __init__(self, order: list[str], seconds: dict[str, float]) -> None:
        self.rank = {name: rank for rank, name in enumerate(order)}
        self.seconds = seconds
        self.failed = ""

    @pytest.hookimpl(tryfirst=True)
    def pytest_collection(self) -> None:
        _quick()

    def pytest_collection_modifyitems(self, items) -> None:
        items.sort(key=lambda item: self.rank.get(item.nodeid, len(self.rank)))

    def pytest_runtest_logstart(self, nodeid: str) -> None:
        limit_processor(3.0 + 5.0 * self.seconds.get(nodeid, 60.0))

    def pytest_runtest_logreport(self, report) -> None:
        self.failed = self.failed or (report.nodeid if report.failed else "")

    def pytest_collectreport(self, report) -> None:
        self.failed = self.failed or (f"{report.nodeid} (import)" if report.failed else "")


def try_anew(root: Path, mutant: Mutant, order: list[str], seconds: dict[str, float]) -> str:
    """Import everything of ours with the mutant in it and run the tests of ``order``."""
    sys.meta_path.insert(0, Mutated(root, mutant))
    judge = Anew(order, seconds)
    limit_processor(30.0)
    files = list(dict.fromkeys(name.split("::")[0] for name in order))
    status = pytest.main([*OPTIONS, "-x", *files], plugins=[judge])
    return judge.failed or ("survived" if status == 0 else f"pytest ended with {status}")
