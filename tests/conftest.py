"""Settings of the whole suite."""

import errno
import gc
import inspect
import os
import pkgutil
import signal
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, Phase, settings

settings.register_profile(
    "deterministic",
    derandomize=True,
    deadline=None,
    database=None,
    suppress_health_check=[HealthCheck.too_slow],
)
# HYPOTHESIS_PROFILE=explore draws new examples, many of them; what it finds is kept as an `@example`
settings.register_profile(
    "explore",
    derandomize=False,
    deadline=None,
    database=None,
    max_examples=int(os.environ.get("HYPOTHESIS_EXAMPLES", "2000")),
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.filter_too_much],
    print_blob=True,
)
# the examples of the first profile, but a failure is not made simpler: for `mutants.py`
settings.register_profile(
    "mutants", settings.get_profile("deterministic"), phases=[Phase.explicit, Phase.generate]
)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "deterministic"))


def pytest_configure() -> None:
    """Let programs import modules of tests, and have Ctrl-C stop this process and its children.

    A shell that starts the tests in the background has them ignore Ctrl-C. The garbage collector rests until
    the tests are collected. Programs keep the modules that they compile, or each would compile all anew.
    """
    gc.disable()
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
    paths = str(Path(__file__).parent), os.environ.get("PYTHONPATH")
    # modules of tests, for the programs that they run
    os.environ["PYTHONPATH"] = os.pathsep.join(filter(None, paths))
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """Give each process whole files, half of all at first; one that is done takes some from the other.

    So what a file computes once, such as pictures that tests compare with, is computed by one process.
    """
    from xdist.scheduler import WorkStealingScheduling

    return WorkStealingScheduling(config, log) if config.getvalue("dist") == "load" else None


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Leave the cases of a test after the first n, `@pytest.mark.first(n)`, to the slow run."""
    seen: Counter[str] = Counter()
    for item in items:
        marker = item.get_closest_marker("first")
        if marker is not None and item.get_closest_marker("slow") is None:
            name = item.nodeid.partition("[")[0]
            seen[name] += 1
            if seen[name] > marker.args[0]:
                item.add_marker(pytest.mark.slow)


def pytest_collection_finish() -> None:
    """Leave the modules and tests out of what the garbage collector looks through during the tests."""
    gc.freeze()
    gc.enable()


# --- What is watched, and what fails ---------------------------------------------------------------


@dataclass
class Call:
    """One call of a function, and what it returned; None while it runs."""

    args: tuple[Any, ...]
    named: dict[str, Any]
    result: Any = None


@pytest.fixture
def calls_of(monkeypatch: pytest.MonkeyPatch) -> Callable[..., list[Call]]:
    """Return a function that notes the calls of another one, given by its name, for what shows nowhere else.

    `instead` is called in its place.
    """

    def watch(name: str, instead: Callable[..., Any] | None = None) -> list[Call]:
        calls: list[Call] = []
        function = instead or pkgutil.resolve_name(name)

        def noted(*args: Any, **named: Any) -> Any:
            calls.append(call := Call(args, named))
            call.result = function(*args, **named)
            return call.result

        monkeypatch.setattr(name, noted)
        return calls

    return watch


@pytest.fixture
def fails(calls_of: Callable[..., list[Call]]) -> Callable[..., list[Call]]:
    """Return a function that has another one, given by its name, raise an error, always or `when` is true."""

    def let_fail(name: str, error: BaseException, when: Callable[..., bool] | None = None) -> list[Call]:
        function = pkgutil.resolve_name(name)

        def failing(*args: Any, **named: Any) -> Any:
            if when is None or when(*args, **named):
                raise error
            return function(*args, **named)

        return calls_of(name, failing)

    return let_fail


@pytest.fixture
def full_disk(fails: Callable[..., list[Call]]) -> Callable[[], object]:
    """Return a function after which no file can be written to the end."""
    return lambda: fails("os.fsync", OSError(errno.ENOSPC, "No space left on device"))


@pytest.fixture
def missing(monkeypatch: pytest.MonkeyPatch) -> Callable[..., None]:
    """Return a function after which packages, given by their names, are not installed."""

    def remove(*packages: str) -> None:
        for package in packages:
            for name in (package, *(each for each in sys.modules if each.startswith(f"{package}."))):
                monkeypatch.setitem(sys.modules, name, None)

    return remove


@pytest.fixture
def set_clock(monkeypatch: pytest.MonkeyPatch) -> Callable[[Callable[[], float]], None]:
    """Return a function that sets the clock of renders."""
    return lambda clock: monkeypatch.setattr(time, "perf_counter", clock)


# --- What counts as long, large or many -------------------------------------------------------------


@pytest.fixture
def long_ago(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let every render count as one that takes long, after which hints are shown."""
    from wavefront.drive import hints

    monkeypatch.setattr(hints, "LONG", 0.0)


@pytest.fixture
def short_training(monkeypatch: pytest.MonkeyPatch) -> None:
    """Train guides with fewer paths, where they need not be good ones."""
    from wavefront.integrators import training

    monkeypatch.setattr(training, "PATHS", 1 << 12)


@pytest.fixture
def shared_instances(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let instances share their mesh with Embree, too, however few triangles it has."""
    from wavefront.accel import registry

    monkeypatch.setattr(registry, "COPIES", 0)


@pytest.fixture
def tree_of_lights(monkeypatch: pytest.MonkeyPatch) -> None:
    """Choose lights by a tree, however few there are."""
    from wavefront.lights import samplers

    monkeypatch.setattr(samplers, "MOST_IN_GRID", 1)


@pytest.fixture
def close_tiles(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let pixels that share paths be next to each other, so that small pictures have whole tiles."""
    from wavefront.sampling import tiles as pixel_tiles

    monkeypatch.setattr(pixel_tiles, "STRIDE", 1)


@pytest.fixture
def no_estimates(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let jobs be admitted until `seconds` are over: what they cost is not known where a machine stutters."""
    from wavefront.drive.jobs import Scheduler

    def late(scheduler: Scheduler, lanes: int) -> bool:
        return scheduler._seconds is not None and scheduler.elapsed > scheduler._seconds

    monkeypatch.setattr(Scheduler, "_late", late)


@pytest.fixture
def principled_recorded(calls_of: Callable[..., list[Call]]) -> None:
    """Let `Principled` of a file be a material that has its parameters, as they were given, in `given`."""
    import wavefront as wf

    signature = inspect.signature(wf.Principled)

    class Recorder(wf.Diffuse):
        def __init__(self, **given: Any) -> None:
            bound = signature.bind(**given)
            bound.apply_defaults()
            self.given = bound.arguments
            super().__init__(0.5)

    calls_of("wavefront.io.description.appearance.Principled", Recorder)


@pytest.fixture
def closed_figures() -> Iterator[None]:
    """Draw without a window, and close all figures."""
    import matplotlib
    from matplotlib import pyplot

    matplotlib.use("Agg")
    yield
    pyplot.close("all")


@pytest.fixture
def tables_restored() -> Iterator[None]:
    """Take what a test registers out of the tables again, so that no other test finds it there."""
    from wavefront.accel.registry import ACCELERATORS
    from wavefront.codecs.images import IMAGE_READERS, IMAGE_WRITERS
    from wavefront.integrators import INTEGRATORS
    from wavefront.io.readers import READERS
    from wavefront.lights.samplers import LIGHT_SAMPLERS
    from wavefront.sampling.filters import FILTERS
    from wavefront.sampling.sampler import SAMPLERS
    from wavefront.workers.executors import EXECUTORS

    tables = [ACCELERATORS, EXECUTORS, FILTERS, IMAGE_READERS, IMAGE_WRITERS, INTEGRATORS, LIGHT_SAMPLERS]
    tables += [READERS, SAMPLERS]
    before = [dict(table._entries) for table in tables]
    yield
    for table, entries in zip(tables, before, strict=True):
        table._entries = entries
