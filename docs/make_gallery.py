"""Render the pictures of the gallery with its examples, and the cards that lead to them.

python docs/make_gallery.py [name ...]

Each picture is what `python examples/NAME.py --size SIZE --spp SPP` renders, as a jpg, denoised where the
table says so. A card is the middle of it, 480 by 320 pixels. It needs pyoidn, and minutes for each picture.
The name `tutorial` stands for the pictures on the tutorial's start page, `figures` for those of a course,
and `how_to` for pictures of how-to pages, each made by the page's first block of code in a larger size.
"""

from __future__ import annotations

import contextlib
import re
import runpy
import sys
import tempfile
from pathlib import Path

import imageio.v3 as iio
from PIL import Image as Pillow

import wavefront as wf

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"
CARD, QUALITY = (480, 320), 86
PICTURES = {  # size, samples per pixel, whether it is denoised, whether it has a card
    "terrace": (1920, 48, True, True),
    "interior": (1200, 24, True, True),
    "scan": (1200, 5, True, True),
    "fruit": (1200, 14, True, True),
    "photograph": (1200, 24, True, True),
    "caustics": (1200, 32, True, True),
    "fog": (1200, 8, True, False),
    "milk": (1200, 64, True, False),
    "cornell_box": (1200, 32, True, True),
    "course_spheres": (1200, 40, True, True),
    "spheres": (1200, 24, True, True),
    "molecule": (1200, 32, True, True),
    "cuboids": (1200, 24, True, True),
    "gltf_scene": (1200, 10, True, True),
    "depth_of_field": (1200, 40, True, True),
    "environment": (1200, 64, True, True),
    "own_material": (1200, 20, True, True),
    "material_sheet": (1200, 8, True, False),
    "skies": (400, 24, True, False),
    "office": (480, 40, True, False),
    "layers": (297, 96, False, False),
    "estimators": (300, 32, False, False),
    "default_look": (1200, 32, True, False),
}
HOW_TO = {  # the file that a page's first block saves, and what is larger or finer in its picture
    "hdri": ("ball.jpg", {"size=(320, 240)": "size=(1200, 900)", "spp=64": "spp=64, denoise=True"}),
    "light": ("lit.jpg", {"size=(320, 240)": "size=(1200, 900)", "spp=64": "spp=64, denoise=True"}),
    "material": ("balls.jpg", {"size=(400, 225)": "size=(1200, 675), denoise=True"}),
    "mesh": ("part.jpg", {"size=(320, 240)": "size=(1200, 900), denoise=True"}),
    "photograph": (
        "composed.jpg",
        {"(320, 240)": "(1200, 900)", "(240, 320, 3)": "(900, 1200, 3)", "100:": "375:", "140)": "525)"},
    ),
    "solar_panel": (
        "panel.jpg",
        {"(28, 22)": "(84, 66)", "spp=64": "spp=256", 'bbox_inches="tight"': 'bbox_inches="tight", dpi=208'},
    ),
}
render = wf.render


def denoised(*args: object, **options: object) -> wf.Image:
    """Render as `wf.render` does, and denoise the picture."""
    return render(*args, **{**options, "denoise": True})


def make(name: str) -> None:
    """Run an example, and write its picture and its card."""
    size, spp, denoise, has_card = PICTURES[name]
    wf.render = denoised if denoise else render
    with tempfile.TemporaryDirectory() as folder:
        output = Path(folder) / "picture.png"
        sys.argv = [f"{name}.py", str(output), "--size", str(size), "--spp", str(spp)]
        runpy.run_path(str(ROOT / "examples" / f"{name}.py"), run_name="__main__")
        picture = Pillow.fromarray(iio.imread(output)[..., :3])
    picture.save(DOCS / f"{name}.jpg", quality=QUALITY, optimize=True, progressive=True)
    if has_card:
        picture = middle(picture).resize(CARD, Pillow.Resampling.LANCZOS)
        picture.save(DOCS / "cards" / f"{name}.jpg", quality=QUALITY, optimize=True)


def make_tutorial() -> None:
    """Run the steps of the tutorial, and write the first two pictures of each beside each other."""
    for script in sorted((DOCS / "tutorial").glob("[0-9]*.py")):
        with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
            runpy.run_path(str(script), run_name="__main__")
            first = [Pillow.open(path).convert("RGB") for path in sorted(Path().glob("*.png"))[:2]]
        scaled = [each.resize((180 * each.width // each.height, 180)) for each in first]
        pair = Pillow.new("RGB", (sum(each.width for each in scaled), 180))
        for k, each in enumerate(scaled):
            pair.paste(each, (sum(other.width for other in scaled[:k]), 0))
        pair.save(DOCS / "tutorial" / "pictures" / f"{script.stem}.jpg", quality=QUALITY, optimize=True)


def make_figures() -> None:
    """Make the figures of a course."""
    script = str(ROOT / "examples" / "course_figures.py")
    for name in runpy.run_path(script)["FIGURES"]:
        with tempfile.TemporaryDirectory() as folder:
            output = Path(folder) / "figure.png"
            sys.argv = [script, str(output), "--figure", name]
            runpy.run_path(script, run_name="__main__")
            picture = Pillow.open(output).convert("RGB")
        picture.save(DOCS / "figures" / f"{name}.jpg", quality=QUALITY, optimize=True, progressive=True)


def make_how_to() -> None:
    """Run the first block of how-to pages in a larger size, and write the picture that it saves."""
    for page, (name, larger) in HOW_TO.items():
        text = (DOCS / "how_to" / f"{page}.md").read_text("utf-8")
        code = re.search(r"^```python\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)[1]
        for shown, finer in larger.items():
            assert shown in code, f"{page}.md has no {shown}"
            code = code.replace(shown, finer)
        with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
            exec(compile(code, page, "exec"), {"__name__": "__main__"})
            picture = Pillow.open(name).convert("RGB")
        picture.save(DOCS / "how_to" / f"{page}.jpg", quality=70, optimize=True, progressive=True)


def middle(picture: Pillow.Image) -> Pillow.Image:
    """Return the largest part in the middle of a picture that has the shape of a card."""
    width, height = picture.size
    wide, high = min(width, height * CARD[0] // CARD[1]), min(height, width * CARD[1] // CARD[0])
    left, top = (width - wide) // 2, (height - high) // 2
    return picture.crop((left, top, left + wide, top + high))


if __name__ == "__main__":
    sys.path[:0] = [str(ROOT / "examples"), str(DOCS / "tutorial")]  # some use parts of others
    (DOCS / "cards").mkdir(exist_ok=True)
    (DOCS / "figures").mkdir(exist_ok=True)
    special = {"tutorial": make_tutorial, "figures": make_figures, "how_to": make_how_to}
    for name in sys.argv[1:] or [*PICTURES, *special]:
        special[name]() if name in special else make(name)
