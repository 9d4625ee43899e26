"""Threads: results in order, few under way, errors and early stops clean."""

import os
import threading
import time

import pytest

import wavefront as wf
from wavefront.parallel import run_ordered, worker_count


@pytest.mark.parametrize("workers", [1, 2, 3, 8])
def test_results_come_in_order(workers: int) -> None:
    """However long each piece takes."""

    def work(piece: int) -> int:
        time.sleep(0.003 * (piece % 3))
        return piece * piece

    assert list(run_ordered(work, range(20), workers)) == [(k, k * k) for k in range(20)]


def test_few_pieces_are_taken_ahead() -> None:
    """A generator of a million pieces is not drained before the first result is used."""
    taken = []

    def pieces():
        for k in range(1_000_000):
            taken.append(k)
            yield k

    results = run_ordered(lambda k: k, pieces(), 2)
    assert next(results) == (0, 0)
    assert len(taken) <= 6
    results.close()


def test_an_error_in_a_piece_reaches_the_caller() -> None:
    """As it was raised."""

    def work(piece: int) -> int:
        if piece == 3:
            raise ValueError("piece 3 failed")
        return piece

    with pytest.raises(ValueError, match="piece 3 failed"):
        list(run_ordered(work, range(10), 2))


def test_no_thread_is_left() -> None:
    """Neither after the end nor after an early stop."""
    before = threading.active_count()
    list(run_ordered(lambda k: k, range(10), 3))
    results = run_ordered(lambda k: k, range(10), 3)
    next(results)
    results.close()
    deadline = time.monotonic() + 5
    while threading.active_count() > before and time.monotonic() < deadline:
        time.sleep(0.01)
    assert threading.active_count() == before


def test_default_is_one_worker_per_core() -> None:
    """Of those that this process may use."""
    assert 1 <= worker_count(None) <= (os.cpu_count() or 1)
    assert worker_count(5) == 5


@pytest.mark.parametrize("workers", [0, -1, 1.5, True, "2"])
def test_bad_worker_counts_are_named(workers) -> None:
    """With the value and the limit."""
    with pytest.raises(wf.SceneError, match=f"workers is {workers!r}.*at least 1"):
        worker_count(workers)
