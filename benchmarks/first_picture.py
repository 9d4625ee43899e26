"""Time from process start to a picture in a file, by default settings, and what noise is left in it.

python benchmarks/first_picture.py --mesh bunny.obj --mesh suzanne.obj [--references FOLDER]
python benchmarks/first_picture.py --without embreex --without pyoidn --cores 1
python benchmarks/first_picture.py --box

Meshes are the eight of first_meshes.py and those given. Every run is a process of its own that does
`wf.render(mesh, size=size).save("out.png")`; columns are medians of wall and CPU seconds. FLIP
(Andersson et al. 2020, of codes without a tone curve, 67 pixels per degree) is that to a converged picture
of the same camera, light and ground: its mean over the picture, its mean over the pixels of the subject and
its shadow, and the 95th percentile of these. `--without` hides packages from these processes, as in an
installation that has none.

`--box` prints import time and the Cornell box at 256x256 and 16 spp beside Mitsuba 3, Mitsuba's own for
Mitsuba; `llvm_ad_rgb` is measured with an empty cache of compiled kernels and with a full one. It needs
`pip install -e '.[bench]'` and an LLVM library (DRJIT_LIBLLVM_PATH); FLIP needs `.[metrics]`.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from statistics import median

import numpy as np
from first_meshes import written

import wavefront as wf

HERE = Path(__file__).resolve().parent
DEFAULT = """
import sys
sys.modules.update(dict.fromkeys({without!r}))
import wavefront as wf
wf.render({mesh!r}, size={size!r}, progress=False).save({out!r})
"""
SHOWN = 0.02  # alpha of a shadow from which on a pixel belongs to it
OURS = """
import sys
sys.path.insert(0, {examples!r})
import wavefront as wf
from cornell_box import cornell_box
wf.render(cornell_box(256), 16, max_bounces=7, branches=1, accel={accel!r}, progress=False).save({out!r})
"""
THEIRS = """
import mitsuba as mi
mi.set_variant({variant!r})
box = mi.cornell_box()
box["sensor"]["film"] = dict(type="hdrfilm", width=256, height=256, rfilter=dict(type="box"))
mi.util.write_bitmap({out!r}, mi.render(mi.load_dict(box), spp=16))
"""


def spent(code: str, home: str | None = None, cores: int | None = None) -> tuple[float, float]:
    """Run a Python process, which may keep bytecode as it does by default; return wall and CPU seconds."""
    environment = {**os.environ, **({} if home is None else {"HOME": home})}
    environment.pop("PYTHONDONTWRITEBYTECODE", None)
    before, begin = os.times(), time.perf_counter()
    limit = (
        None if cores is None else lambda: os.sched_setaffinity(0, sorted(os.sched_getaffinity(0))[:cores])
    )
    subprocess.run([sys.executable, "-c", code], check=True, env=environment, preexec_fn=limit)
    seconds, after = time.perf_counter() - begin, os.times()
    cpu = after.children_user + after.children_system - before.children_user - before.children_system
    return seconds, cpu


def flip(picture: wf.Image, exact: wf.Image) -> np.ndarray:
    """Return the FLIP (H, W) of two pictures as sRGB shows them."""
    from flip_evaluator import evaluate

    codes = [each.to_uint8(tone="none")[..., :3].astype(np.float32) / 255 for each in (exact, picture)]
    found: np.ndarray = evaluate(*codes, "LDR", inputsRGB=True, applyMagma=False)[0]
    return found[..., 0] if found.ndim == 3 else found


def converged(mesh: Path, size: tuple[int, int], options: argparse.Namespace) -> wf.Image:
    """Return a converged picture, from the folder where it is kept."""
    path = options.references / f"{mesh.stem}_{size[0]}x{size[1]}_{options.reference_spp}.npz"
    if not path.exists():
        options.references.mkdir(parents=True, exist_ok=True)
        wf.render(
            mesh, options.reference_spp, size=size, branches=4, seed=1000, denoise=True, progress=False
        ).save(path)
    return wf.Image.load(path)


def noise_left(mesh: Path, size: tuple[int, int], out: Path, options: argparse.Namespace) -> str:
    """Return samples per pixel, FLIP of the picture, of subject and shadow, and the worst of these."""
    code = DEFAULT.format(without=tuple(options.without), mesh=str(mesh), size=size, out=str(out))
    spent(code)
    picture = wf.Image.load(out)
    found = flip(picture, converged(mesh, size, options))
    shadow = wf.render(mesh, 16, size=size, ground="shadow", background="transparent", progress=False)
    there = found[shadow.alpha > SHOWN]
    return (
        f"{picture.spp:5d}{found.mean():8.4f}{there.mean():8.4f}{np.percentile(there, 95):8.4f}"
        f"  {picture.metadata.get('denoiser', '')}"
    )


def meshes(options: argparse.Namespace) -> None:
    """Print the table of default pictures of meshes."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "out.png"
        paths = [*options.mesh, *written(Path(folder))]
        for size in options.size:
            rows = []
            print(
                f"\n{size[0]}x{size[1]}       triangles    wall     CPU"
                + "  spp    FLIP subject  95 %" * bool(options.references)
            )
            for mesh in paths:
                code = DEFAULT.format(without=tuple(options.without), mesh=str(mesh), size=size, out=str(out))
                times = [spent(code, cores=options.cores) for _ in range(options.repeat)]
                wall, cpu = (median(each) for each in zip(*times, strict=True))
                rows.append((wall, cpu))
                noise = noise_left(mesh, size, out.with_suffix(".npz"), options) if options.references else ""
                faces = sum(len(shape.faces) for shape in wf.load(mesh, progress=False).shapes)
                print(f"{mesh.stem:14}{faces:8d}{wall:8.2f}{cpu:8.2f}{noise}", flush=True)
            walls, cpus = zip(*rows, strict=True)
            print(f"{'median':22}{median(walls):8.2f}{median(cpus):8.2f}")
            print(f"{'most':22}{max(walls):8.2f}{max(cpus):8.2f}")


def box(repeat: int) -> None:
    """Print import time, and times of the Cornell box beside Mitsuba."""
    with tempfile.TemporaryDirectory() as folder:
        names = {
            "examples": str(HERE.parent / "examples"),
            "out": str(Path(folder) / "out.png"),
        }
        jobs = {
            "import numpy": "import numpy",
            "import wavefront": "import wavefront",
            "import mitsuba": "import mitsuba; mitsuba.set_variant('llvm_ad_rgb')",
            "wavefront numpy": OURS.format(accel="numpy", **names),
            "wavefront embree": OURS.format(accel="embree", **names),
            "mitsuba scalar_rgb": THEIRS.format(variant="scalar_rgb", **names),
            "mitsuba llvm_ad_rgb, cold": THEIRS.format(variant="llvm_ad_rgb", **names),
            "mitsuba llvm_ad_rgb, cached": THEIRS.format(variant="llvm_ad_rgb", **names),
        }
        times: dict[str, list[float]] = {name: [] for name in jobs}
        kept = tempfile.mkdtemp(dir=folder)
        for code in jobs.values():  # a first time, for bytecode and compiled kernels
            spent(code, kept)
        for _ in range(repeat):
            for name, code in jobs.items():
                home = tempfile.mkdtemp(dir=folder) if "cold" in name else kept
                times[name].append(spent(code, home)[0])
    for name, values in times.items():
        print(f"{name:30}{median(values):8.2f} s")


def size_of(text: str) -> tuple[int, int]:
    """Return the size that an option names, such as 512x512."""
    width, _, height = text.partition("x")
    return int(width), int(height)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--repeat", type=int, default=3)
    parser.add_argument("--mesh", type=Path, action="append", default=[], help="a file besides the eight")
    parser.add_argument("--size", type=size_of, action="append", help="such as 512x512; both by default")
    parser.add_argument("--cores", type=int, help="how many a process may use; all by default")
    parser.add_argument("--without", action="append", default=[], help="a package that processes do not find")
    parser.add_argument("--references", type=Path, help="folder of converged pictures, made where missing")
    parser.add_argument("--reference-spp", type=int, default=320, help="their samples, times four branches")
    parser.add_argument("--box", action="store_true", help="the Cornell box, beside Mitsuba")
    chosen = parser.parse_args()
    chosen.size = chosen.size or [(512, 512), (1920, 1080)]
    box(chosen.repeat) if chosen.box else meshes(chosen)
