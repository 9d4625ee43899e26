"""Mitsuba's test scenes, rendered here and compared with the reference pictures that come with them.

    python benchmarks/mitsuba_references.py FOLDER [--page docs/record/mitsuba_references.md] [--only spheres]

FOLDER is a checkout of https://github.com/mitsuba-renderer/mitsuba-data. Each scene of its `tests/scenes` has
a picture of 32 000 samples per pixel, and the variance. Needs `mitsuba` (extra `[bench]`), which renders each
scene, too. Prints a table, and writes it into a page of the documentation.
"""

from __future__ import annotations

import argparse
import datetime
import json
import re
import shutil
import subprocess
import tempfile
import time
import warnings
from copy import copy
from pathlib import Path
from statistics import NormalDist
from typing import Any
from unittest.mock import patch

import numpy as np

import wavefront as wf
from wavefront.bsdfs import thin
from wavefront.bsdfs.fresnel import fresnel_dielectric

REFERENCE_SPP, SIGNIFICANCE, LEAST_SHARE, LEAST_VARIANCE = 32_000, 0.01, 0.9975, 1e-4  # of test_renders.py
THIN = "thindielectric"
ROUNDING = 1e-5  # of the mean of a picture, in float32
UNLIKELY = 1e-4  # p-value that one of a hundred reports of as many scenes has by chance
START, END = "<!-- report -->", "<!-- end -->"  # around what is written into the page
TO_XYZ = np.array(  # of its bitmaps
    [[0.412453, 0.357580, 0.180423], [0.212671, 0.715160, 0.072169], [0.019334, 0.119193, 0.950227]]
)
Array = np.ndarray
COLUMNS = "scene", "spp", "ratio ± σ", "share", "p", "p live", "Mitsuba", "CPU s", "verdict"


def without_media(folder: Path, scene: Path, place: Path) -> Path:
    """Write a scene of thin glass in media without these, and return its path."""
    for part in (Path("common"), scene.parent.relative_to(folder)):
        shutil.copytree(folder / part, place / part)
    clear = place / scene.relative_to(folder)
    text = re.sub('<ref id="medium1" name="interior"/>', "", scene.read_text())
    shapes = re.findall("<shape.*?</shape>", text, re.DOTALL)
    for nothing in (shape for shape in shapes if 'type="null"' in shape):
        text = text.replace(nothing, "")
    clear.write_text(text)
    return clear


def with_thin_glass(mi: Any, folder: Path, scene: Path, spp: int) -> tuple[list[float], list[float]]:
    """Return p of our picture without the media and of `volpath`, each against Mitsuba's `path`."""
    with tempfile.TemporaryDirectory() as name:
        clear = without_media(folder, scene, Path(name))
        with patch.object(thin, "fresnel_sheet", averaged_sheet):
            ours, *_ = rendered_here(Path(name), clear, spp)
        path, volpath = (rendered_there(mi, clear, spp, kind)[0] for kind in ("path", "volpath"))
        return of_levels(in_xyz(ours), path), of_levels(volpath, path)


def averaged_sheet(cos: Array, eta: Array) -> Array:
    """Return the reflectance (n,) of a sheet as in Mitsuba, which averages polarizations at each face."""
    face, _ = fresnel_dielectric(cos, eta)
    return 2 * face / (1 + face)


def to_xyz(rgb: Array) -> Array:
    """Convert colors (H, W, 3)."""
    return np.stack([(rgb.astype(float) * row).sum(-1) for row in TO_XYZ], -1)


def share_within(xyz: Array, spp: int, reference: Array, variance: Array) -> float:
    """Return the share of channels that pass the z-test of Mitsuba's `test_renders.py`, all in XYZ."""
    alpha = 1 - (1 - SIGNIFICANCE) ** (1 / (xyz.shape[0] * xyz.shape[1]))
    z = np.abs(xyz - reference) * np.sqrt(spp / np.maximum(variance, LEAST_VARIANCE))
    return float((z < NormalDist().inv_cdf(1 - alpha / 2)).mean())


def in_xyz(picture: Any) -> Any:
    """Return a picture in XYZ; its errors are those of channels that err together, the largest possible."""
    found = copy(picture)
    found.rgb, found.standard_error = (to_xyz(each) for each in (picture.rgb, picture.standard_error))
    found.variance = np.square(to_xyz(np.sqrt(picture.variance)))
    return found


def independent(mean: Array, variance: Array, spp: int) -> wf.Image:
    """Return a picture (H, W, 3) of independent samples with its errors, at least those of rounding."""
    variance = np.maximum(variance, spp * (ROUNDING * mean.mean()) ** 2)
    return wf.Image(
        mean.astype(np.float32),
        spp,
        counts=np.full(mean.shape[:2], spp),
        variance=variance.astype(np.float32),
        standard_error=np.sqrt(variance / spp).astype(np.float32),
    )


def reference_of(scene: Path) -> Path:
    """Return the file of a scene's reference."""
    return scene.parent / "refs" / f"{scene.stem.rpartition('_')[0]}_ref_rgb.exr"


def rendered_here(folder: Path, scene: Path, spp: int) -> tuple[Any, str, float]:
    """Return our picture, what the importer did not honor, and the CPU time.

    One worker, whose time this process can tell. The picture is the same with more.
    """
    begin = time.process_time()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        loaded = wf.load(scene, search_paths=[folder], progress=False)
        picture = wf.render(loaded, spp, progress=False, workers=1)
    took = time.process_time() - begin
    told = [each.said(str(scene)).removeprefix("not honored: ") for each in loaded.losses]
    return picture, "; ".join(dict.fromkeys(re.sub(r"line \d+: ", "", each) for each in told)), took


def rendered_there(mi: Any, scene: Path, spp: int, kind: str) -> tuple[wf.Image, float]:
    """Return Mitsuba's picture in XYZ, and the CPU time; light tracing would have no moments."""
    begin = time.process_time()
    loaded = mi.load_file(str(scene), spp=spp, integrator=kind)
    integrator = loaded.integrator()
    if integrator.class_name() != "MomentIntegrator":
        integrator = mi.load_dict({"type": "moment", "nested": integrator})
    channels = np.array(mi.render(loaded, integrator=integrator, spp=spp))[..., -6:].astype(float)
    mean, second = channels[..., :3], channels[..., 3:]
    return independent(mean, second - np.square(mean), spp), time.process_time() - begin


def examine(mi: Any, folder: Path, scene: Path, samples: float) -> list[str]:
    """Render a scene on both sides, compare, and return the row of the table."""
    file, kind = reference_of(scene), scene.stem.rpartition("_")[2].replace("ptracer", "path")
    mean, variance = (to_xyz(wf.Image.load(f"{file.with_suffix('')}{end}.exr").rgb) for end in ("", "_var"))
    reference = independent(mean, variance, REFERENCE_SPP)
    spp = max(2, int(samples / mean[..., 0].size))
    picture, not_honored, seconds = rendered_here(folder, scene, spp)
    ours = in_xyz(picture)
    theirs, their_seconds = rendered_there(mi, scene, spp, kind)
    share = share_within(ours.rgb, spp, mean, variance)
    pairs = ((ours, reference), (ours, theirs), (theirs, reference))
    p, live, control = (of_levels(*pair) for pair in pairs)
    passed = share >= LEAST_SHARE
    alike = min(*p, *live) >= UNLIKELY
    verdict = "pass" if passed else "fails by noise" if alike else "fails"
    if not_honored and (not passed or min(live) < UNLIKELY):
        verdict = f"unsupported: {not_honored}"
    elif min(live) < UNLIKELY and THIN in scene.read_text() and "volpath" in kind:
        without, itself = with_thin_glass(mi, folder, scene, spp)
        known = min(without) >= UNLIKELY > min(itself)
        verdict = "pass; " if passed else ""
        verdict += "model difference: thin glass in volpath" if known else "fails, even without media"
        verdict += f"; without media p {chances(without)}, of volpath itself {chances(itself)}"
    elif not alike:
        verdict += "; reference of an older version" if min(live) >= UNLIKELY > min(control) else "; differs"
    error = np.sqrt(np.square(picture.standard_error.astype(float)).sum((0, 1))) / picture.rgb.sum((0, 1))
    of_reference = np.sqrt(np.maximum(variance[..., 1], 0).sum() / REFERENCE_SPP) / mean[..., 1].sum()
    ratio = picture.rgb.astype(float).mean((0, 1)) / wf.Image.load(file).rgb.astype(float).mean((0, 1))
    sigma = np.hypot(error, of_reference)
    return [
        f"{scene.parent.name}/{scene.stem.removeprefix('test_')}",
        str(spp),
        ", ".join(f"{r:.4f} ± {s:.4f}" for r, s in zip(ratio, sigma, strict=True)),
        percent(share),
        chances(p),
        chances(live),
        f"{percent(share_within(theirs.rgb, spp, mean, variance))}; {chances(control)}",
        f"{seconds:.1f}, {their_seconds:.1f}",
        verdict,
    ]


def of_levels(a: wf.Image, b: wf.Image) -> list[float]:
    """Return the p-values of pixels and of blocks."""
    found: Any = wf.compare(a, b)
    return [found.p_pixels, found.p_blocks]


def table(rows: list[list[str]]) -> str:
    """Return the rows in Markdown."""
    return "\n".join(f"| {' | '.join(cells)} |" for cells in (COLUMNS, ["---"] * len(COLUMNS), *rows))


def percent(share: float) -> str:
    """Return a share in per cent, rounded down."""
    return f"{np.floor(1e4 * share) / 100:g} %"


def chances(p: list[float]) -> str:
    """Return p-values."""
    return ", ".join("< 1e-9" if each < 1e-9 else f"{each:.1g}" for each in p)


def told(rows: list[list[str]], mi: Any, folder: Path) -> str:
    """Return the part of the page that is written here."""
    run = subprocess.run(["git", "-C", folder, "rev-parse", "HEAD"], capture_output=True, text=True)
    kinds = [re.split("[:;,]", row[-1])[0] for row in rows]
    verdicts = ", ".join(f"{kinds.count(kind)} {kind}" for kind in dict.fromkeys(kinds))
    return f"""{START}
{datetime.date.today()}, wavefront {wf.__version__}, Mitsuba {mi.__version__} ({mi.variant()}), mitsuba-data
{run.stdout.strip() or "of no known revision"}; {len(rows)} scenes: {verdicts}.

{table(rows)}
{END}"""


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path)
    parser.add_argument("--only", default="", help="part of the paths of scenes")
    parser.add_argument("--samples", type=float, default=2e6, help="of a picture, as in Mitsuba's test")
    parser.add_argument("--page", type=Path, help="file to write the table into")
    parser.add_argument("--keep", type=Path, help="json file of rows, which are not rendered again")
    options = parser.parse_args()
    import mitsuba

    mitsuba.set_variant("llvm_ad_rgb")
    root = options.folder.resolve()
    kept = json.loads(options.keep.read_text()) if options.keep and options.keep.exists() else {}
    found = []
    for path in sorted((root / "tests/scenes").glob("*/*.xml")):
        if options.only not in str(path.relative_to(root)) or not reference_of(path).exists():
            continue
        if str(path) not in kept:
            kept[str(path)] = examine(mitsuba, root, path, options.samples)
            if options.keep:
                options.keep.write_text(json.dumps(kept, indent=1))
        found.append(kept[str(path)])
        print(table(found[-1:]).splitlines()[-1], flush=True)
    if options.page:
        before, after = (options.page.read_text().split(mark)[i] for i, mark in enumerate((START, END)))
        options.page.write_text(before + told(found, mitsuba, root) + after)
