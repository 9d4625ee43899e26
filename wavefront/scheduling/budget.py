"""The memory budget: how large waves are, and how many workers there are, within a limit of memory."""

from __future__ import annotations

from collections.abc import Sequence

from ..arrays.soa import soa
from ..core.errors import SceneError
from ..core.memory import check_memory, megabytes, resident_memory
from ..core.plural import plural
from .accumulator import picture_memory
from .scheduler import SMALL_WAVE, default_wave_size

LANE_BYTES = 1000  # of a lane of a wave, with its share of results that wait to be added
PROCESS_BYTES = 70 << 20  # of a worker process beside its wave: pages it does not share, and what glibc keeps
THREAD_BYTES = 35 << 20  # of a worker thread beside its wave: its stack, and the buffer of OpenBLAS
GOOD_WAVE = 1 << 14  # lanes; there are fewer workers rather than smaller waves
LEAST_WAVE = 1 << 10  # lanes; with less memory than such a wave needs there is no render


@soa
class Budget:
    """What is traced at once."""

    workers: int
    wave_size: int  # lanes of the largest wave


def make_budget(
    max_memory: int | None,
    size: tuple[int, int],
    workers: int,
    wave_size: int | None,
    processes: bool,
    layers: Sequence[str] = (),
    light_tracing: bool = False,
) -> Budget:
    """Return how many workers trace waves of how many lanes.

    Parameters
    ----------
    max_memory
        Bytes that this process, with what it uses already, and its workers may use; None for any.
    size, layers, light_tracing
        As for `picture_memory`, of a picture for which no memory is in use yet.
    workers, wave_size
        The most of each; a `wave_size` of None stands for what suits the workers.
    processes
        Whether workers are processes.

    Raises
    ------
    SceneError
        If the picture needs more memory than is available, or even one worker with a small wave needs more
        than `max_memory`.
    """
    picture = picture_memory(size, layers, light_tracing)
    having = f" with {plural(len(layers), 'AOV')}" if layers else ""
    check_memory(f"a picture of {size[0]}x{size[1]} pixels{having}", picture)
    if max_memory is None:
        return Budget(workers, wave_size or default_wave_size(workers))
    fixed = PROCESS_BYTES if processes else THREAD_BYTES
    in_use = resident_memory()
    worker = fixed + min(LEAST_WAVE, wave_size or LEAST_WAVE) * LANE_BYTES
    left = max_memory - in_use - picture
    if left < worker:
        raise SceneError(
            f"max_memory is {megabytes(max_memory)}; {megabytes(in_use + picture + worker)} are needed: "
            f"{megabytes(in_use)} are in use already, {megabytes(picture)} are for a picture of "
            f"{size[0]}x{size[1]} pixels, and {megabytes(worker)} for one worker"
        )
    good = min(GOOD_WAVE, wave_size or GOOD_WAVE)
    workers = max(1, min(workers, left // (fixed + good * LANE_BYTES)))
    largest = wave_size or SMALL_WAVE  # at any speed, so that the peak does not depend on it
    return Budget(workers, min(largest, (left // workers - fixed) // LANE_BYTES))
