"""Settings of the whole suite."""

import gc
import os
import signal
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

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
    the tests are collected.
    """
    gc.disable()
    paths = str(Path(__file__).parent), os.environ.get("PYTHONPATH")
    # modules of tests, for the programs that they run
    os.environ["PYTHONPATH"] = os.pathsep.join(filter(None, paths))
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)


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


@pytest.fixture
def close_tiles(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let pixels that share paths be next to each other, so that small pictures have whole tiles."""
    from wavefront.sampling import tiles as pixel_tiles

    monkeypatch.setattr(pixel_tiles, "STRIDE", 1)


@pytest.fixture
def no_estimates(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let jobs be admitted until `seconds` are over: what they cost is not known where a machine stutters."""
    from wavefront.scheduling.scheduler import Scheduler

    def late(scheduler: Scheduler, lanes: int) -> bool:
        return scheduler._seconds is not None and scheduler.elapsed > scheduler._seconds

    monkeypatch.setattr(Scheduler, "_late", late)


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
    from wavefront.scheduling.executors import EXECUTORS

    tables = [ACCELERATORS, EXECUTORS, FILTERS, IMAGE_READERS, IMAGE_WRITERS, INTEGRATORS, LIGHT_SAMPLERS]
    tables += [READERS, SAMPLERS]
    before = [dict(table._entries) for table in tables]
    yield
    for table, entries in zip(tables, before, strict=True):
        table._entries = entries
