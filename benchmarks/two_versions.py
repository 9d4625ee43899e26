"""What a picture by default costs in two versions of this project: variance times CPU time, and means.

python benchmarks/two_versions.py OTHER [--scenes NAME ...] [--size 192] [--spp 16] [--seeds 4]

OTHER is a checkout of the other version, such as one by `git worktree add OTHER COMMIT`. The scenes are
those of equal_error.py, built by each version's own file. Each version renders them in a process of its own,
by one thread with default settings; the two take turns, seed by seed. Printed are, for each scene, what the
other version and this one chose; this one's variance and CPU time over the other's; the gain, which is one
over their product, for pixels and after blurs of 1.5 and 4 pixels; and the ratio of the means, with the p of
a t-test over the seeds. Variance is that of `equal_error.py`.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from statistics import median

import numpy as np
from equal_error import ALL_SCENES, SCENES, errors
from scipy.stats import ttest_ind

HERE = Path(__file__).resolve().parents[1]
WORKER = """
import json, sys, time, warnings
warnings.simplefilter("ignore")
answers, sys.stdout = sys.stdout, sys.stderr
import numpy as np
import wavefront as wf
import equal_error
equal_error.decide_with(1)
for line in sys.stdin:
    name, size, spp, seed, file = json.loads(line)
    if seed == 0:
        subject = equal_error.ALL_SCENES[name](size)
        scene, given = subject if isinstance(subject, tuple) else (subject, {})
        spp = 1
    begin = time.process_time()
    how = {**given, "workers": 1, "executor": "threads", "progress": False}
    image = wf.render(scene, spp, seed=seed, **how)
    seconds = time.process_time() - begin
    np.save(file, image.rgb)
    chosen = "shared" if image.metadata["reuse"] else str(image.metadata["branches"])
    print(json.dumps([seconds, chosen]), file=answers, flush=True)
"""


class Version:
    """A process that renders by the version in a folder."""

    def __init__(self, folder: Path, scratch: Path) -> None:
        environment = {
            **os.environ,
            "PYTHONPATH": os.pathsep.join([str(folder), str(folder / "benchmarks")]),
            "OMP_NUM_THREADS": "1",
        }
        self._file = scratch / "picture.npy"
        self._process = subprocess.Popen(
            [sys.executable, "-c", WORKER],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            cwd=folder,
            env=environment,
        )

    def render(self, name: str, size: int, spp: int, seed: int) -> tuple[np.ndarray, float, str]:
        """Return a picture, the CPU seconds it took, and what was chosen; seed 0 builds the scene."""
        process = self._process
        assert process.stdin
        assert process.stdout
        process.stdin.write(json.dumps([name, size, spp, seed, str(self._file)]) + "\n")
        process.stdin.flush()
        seconds, chosen = json.loads(process.stdout.readline())
        return np.load(self._file).astype(np.float64), seconds, chosen


def row(name: str, versions: list[Version], options: argparse.Namespace) -> tuple[str, float]:
    """Return the row of a scene, and its gain for pixels."""
    found: list[list[tuple[np.ndarray, float, str]]] = [[], []]
    for seed in range(options.seeds + 1):
        for which in (0, 1) if seed % 2 else (1, 0):
            answer = versions[which].render(name, options.size, options.spp, seed)
            if seed:
                found[which].append(answer)
    pictures = [[picture for picture, _, _ in side] for side in found]
    means = [[picture.mean() for picture in side] for side in pictures]
    variance = np.divide(*(errors(side, np.mean(side, axis=0)) for side in reversed(pictures)))
    cpu = np.divide(*(median(seconds for _, seconds, _ in side) for side in reversed(found)))
    gains = 1 / (variance * cpu)
    chosen = " to ".join(side[0][2].strip() for side in found)
    figures = [f"{each:.2f}" for each in (variance[0], cpu, *gains)]
    ratio, chance = np.mean(means[1]) / np.mean(means[0]), ttest_ind(*means).pvalue
    return " | ".join([f"| {name}", chosen, *figures, f"{ratio:.4f}", f"{chance:.1g} |"]), gains[0]


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("other", type=Path)
    parser.add_argument("--scenes", nargs="*", default=list(SCENES), choices=ALL_SCENES, metavar="NAME")
    parser.add_argument("--size", type=int, default=192)
    parser.add_argument("--spp", type=int, default=16)
    parser.add_argument("--seeds", type=int, default=4)
    options = parser.parse_args()
    print(f"{options.size}x{options.size} pixels, {options.spp} spp, {options.seeds} seeds\n")
    print("| scene | chosen | variance | CPU time | gain, pixels | blur 1.5 | blur 4 | means | p |")
    print("|---|---|---|---|---|---|---|---|---|")
    gains = []
    with tempfile.TemporaryDirectory() as scratch:
        versions = []
        for number, folder in enumerate((options.other.resolve(), HERE)):
            place = Path(scratch) / str(number)
            place.mkdir()
            versions.append(Version(folder, place))
        for name in options.scenes:
            line, gain = row(name, versions, options)
            print(line, flush=True)
            gains.append(gain)
    print(f"\nmedian of the gains for pixels: {median(gains):.2f}, the least: {min(gains):.2f}")


if __name__ == "__main__":
    main()
