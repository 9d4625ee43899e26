"""Every Python block of the README and the documents runs, and no link leads nowhere."""

import ast
import importlib
import re
import sys
import tomllib
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from inside import ORDER

import wavefront as wf

ROOT = Path(__file__).parents[2]
PAGES = sorted(
    [
        *(ROOT / "docs").glob("*.md"),
        *(ROOT / "docs" / "how_to").glob("*.md"),
        *(ROOT / "docs" / "record").glob("*.md"),
    ]
)
DOCUMENTS = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *PAGES]
TUTORIAL = sorted((ROOT / "docs" / "tutorial").glob("[0-9]*.py"))
TRACER = ROOT / "docs" / "tutorial" / "tracer.py"
BLOCK = re.compile(r"^```python\n(.*?)^```$", re.MULTILINE | re.DOTALL)
LINK = re.compile(r"\]\(([^)#]*)(?:#([^)]*))?\)")
HEADING = re.compile(r"^#+ (.*)$", re.MULTILINE)
MOST_SPP = 1
# what is in blocks that take more than a second: other libraries, a year of suns, the slower denoiser
HEAVY = "import pyvista", "LocalCluster", "wf.Sky.perez(direct", ".denoise().rgb", "ball_and_stick"


def blocks():
    for document in DOCUMENTS:
        for number, match in enumerate(BLOCK.finditer(document.read_text("utf-8"))):
            line = document.read_text("utf-8")[: match.start(1)].count("\n") + 1
            name = f"{document.name}-{number}"
            marks = pytest.mark.slow if any(word in match[1] for word in HEAVY) else []
            yield pytest.param(document, line, match[1], id=name, marks=marks)


@pytest.fixture
def few_samples(tmp_path, monkeypatch, short_training):
    """Let renders take few samples of each of few pixels, and guides learn little, in an empty folder."""
    render, render_many, measure = wf.render, wf.render_many, wf.measure

    def quick(scene, spp=MOST_SPP, noise=None, **options):
        few = {"spp": min(spp, MOST_SPP)}
        if "samples" in options:  # of which something is compared, so that they have errors
            samples = options.pop("samples")
            few = {"samples": min(samples, 4) if isinstance(samples, int) else samples}
        if "camera" not in options and getattr(scene, "camera", None) is None:
            width, height = options.pop("size", (48, 32))
            few["size"] = (width // 3, height // 3) if width > 200 else (width, height)
        elif isinstance(scene, wf.Scene) and not options.keys() & {"size", "background"}:
            # with a background the picture is put over an array of the size that the camera has
            width, height = (options.get("camera") or scene.camera).size
            few["size"] = (width // 5, height // 5) if width > 200 else (width, height)
        return render(scene, **few, progress=False, **options)

    def quick_many(scene, cameras, spp=MOST_SPP, **options):
        return render_many(scene, cameras, min(spp, MOST_SPP), progress=False, **options)

    def quick_measure(*arguments, **options):
        few = {} if options.keys() & {"samples", "noise"} else {"spp": min(options.get("spp", 32), 32)}
        return measure(*arguments, **options | few)

    monkeypatch.setattr(wf, "measure", quick_measure)
    monkeypatch.setattr(wf, "render", quick)
    monkeypatch.setattr(wf, "render_many", quick_many)
    monkeypatch.chdir(tmp_path)


@pytest.mark.usefixtures("few_samples")
@pytest.mark.parametrize(("document", "line", "code"), list(blocks()))
def test_block_runs(document, line, code, tmp_path):
    exec(compile("\n" * (line - 1) + code, str(document), "exec"), {"__name__": "__main__"})
    for picture in tmp_path.iterdir():
        assert picture.stat().st_size > 100


@pytest.fixture
def tracer(monkeypatch):
    """Return the module that the tutorial builds, whose `render` traces one path for each pixel."""
    monkeypatch.syspath_prepend(TRACER.parent)
    monkeypatch.delitem(sys.modules, "tracer", raising=False)
    module = importlib.import_module("tracer")
    render = module.render
    monkeypatch.setattr(
        module, "render", lambda one, w, h, paths, *seed: render(one, w, h, min(paths, 1), *seed)
    )
    yield module
    del sys.modules["tracer"]


@pytest.mark.usefixtures("few_samples", "tracer")
@pytest.mark.parametrize("script", TUTORIAL, ids=lambda path: path.stem)
def test_step_of_the_tutorial_runs(script, tmp_path):
    exec(compile(script.read_text("utf-8"), str(script), "exec"), {"__name__": "__main__"})
    assert list(tmp_path.glob("*.png"))


def functions(path):
    """Return the functions of a file by name, as their syntax trees."""
    tree = ast.parse(path.read_text("utf-8"))
    return {node.name: ast.dump(node) for node in tree.body if isinstance(node, ast.FunctionDef)}


def test_the_steps_of_the_tutorial_build_the_tracer():
    """Every function of the whole is in a step, the same, and the whole has about a hundred lines."""
    whole, shown = functions(TRACER), {}
    for script in TUTORIAL:
        for name, tree in functions(script).items():
            assert whole.get(name, tree) == tree, f"{script.name}: {name}"
            shown[name] = tree
    assert whole.keys() <= shown.keys()
    lines = [line.strip() for line in TRACER.read_text("utf-8").splitlines()]
    assert len([line for line in lines if line and line[0] != "#"]) <= 150


@pytest.mark.parametrize(
    ("name", "parts", "limit"),
    [("full", 24, 0.03), pytest.param("naive", 64, 0.09, marks=pytest.mark.slow)],
)
def test_the_tracer_of_the_tutorial_is_right(name, parts, limit, tracer):
    """All its estimators agree with the library, in a room without the glass, whose caustic is noisy."""
    tracer.KIND[8] = tracer.MATTE
    kinds = {tracer.MIRROR: wf.Mirror, tracer.MATTE: wf.Diffuse}
    balls = [
        wf.Sphere(center, radius, material=kinds[kind](color), emission=light if light.any() else None)
        for center, radius, kind, color, light in zip(
            tracer.CENTER, tracer.RADIUS, tracer.KIND, tracer.COLOR, tracer.EMISSION, strict=False
        )
    ]
    camera = wf.Camera.look_at(tracer.EYE, tracer.TARGET, fov=60, size=(16, 12))
    means = [tracer.render(getattr(tracer, name), 16, 12, 2, seed).mean() for seed in range(parts)]
    exact = wf.render(wf.Scene(balls, camera=camera), 512, max_bounces=5, progress=False).rgb.mean()
    error = np.std(means, ddof=1) / np.sqrt(parts)
    # Student's t with 23 degrees of freedom is beyond 4.5 with a probability of 2e-4
    assert abs(np.mean(means) - exact) < 4.5 * error
    assert error < limit * exact


def test_a_mirror_of_the_tutorial_cancels_the_cosine(tracer):
    """f·cosθ/p is the reflectance for a delta, which is written as density infinity."""
    direction = np.array([[0.6, -0.8, 0.0]])
    following, factor, pdf = tracer.scatter(
        direction, np.array([[0.0, 1, 0]]), np.array([7]), np.random.default_rng(0)
    )
    np.testing.assert_allclose(following, [[0.6, 0.8, 0]])
    np.testing.assert_array_equal(factor, tracer.COLOR[[7]])
    assert np.isinf(pdf).all()


def test_formulas_are_typeset_without_another_server():
    settings = (ROOT / "docs" / "conf.py").read_text("utf-8")
    assert "sphinx-mathjax-offline" in settings
    for script in TUTORIAL[:8]:
        assert ".. math::" in script.read_text("utf-8"), script.name
    for script in TUTORIAL:
        text = script.read_text("utf-8")
        assert "# Exercises" in text, script.name
        assert "*Expect*" in text, script.name
        assert "In the library" in text or "What is where" in text, script.name


def anchors(document):
    """Return the names that GitHub gives to the headings of a document."""
    headings = HEADING.findall(document.read_text("utf-8"))
    return {re.sub(r"[^\w -]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize(
    "document",
    [*DOCUMENTS, ROOT / "CHANGELOG.md", ROOT / "benchmarks" / "README.md"],
    ids=lambda path: str(path.relative_to(ROOT)),
)
def test_links_lead_somewhere(document):
    links = LINK.findall(document.read_text("utf-8"))
    missing = []
    for path, anchor in links:
        target = document.parent / path if path else document
        if ":" in path:
            continue
        if not target.exists() or (anchor and anchor not in anchors(target)):
            missing.append(f"{path}#{anchor}")
    assert missing == []


def test_files_named_in_the_documents_exist():
    """But for the records, which name files of their time."""
    files = {f"/{path.relative_to(ROOT).as_posix()}" for path in ROOT.glob("[!.]*/**/*.py")}
    for document in DOCUMENTS:
        for name in re.findall(r"`([\w/]+\.py)`", document.read_text("utf-8")):
            found = any(file.endswith(f"/{name}") for file in files)
            assert found or document.parent.name == "record", f"{document.name}: {name}"


def test_the_list_of_pages_has_every_document():
    pages = {path for path, _ in LINK.findall((ROOT / "docs" / "pages.md").read_text("utf-8"))}
    documents = {path.relative_to(ROOT / "docs").as_posix() for path in PAGES}
    assert documents - pages == {"pages.md"}


def test_the_start_page_has_pictures_that_lead_to_answers():
    """And a first command whose lines are not cut off at the width of the site's column."""
    text = (ROOT / "docs" / "index.md").read_text("utf-8")
    cards = re.findall(r"\[!\[([^\]]+)\]\((cards/[^)]+)\)\]\(([^)]+)\)<br>\[([^\]]+)\]\(([^)]+)\)", text)
    assert len(cards) == 12
    assert all(link == again for _, _, link, _, again in cards)
    commands = re.findall(r"^```sh\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)
    assert commands
    assert max(len(line) for line in "".join(commands).splitlines()) <= 60
    assert not re.search(r"^- ", text, re.MULTILINE)


def test_the_packages_of_the_architecture_are_the_layers():
    """The table has every module and folder, in the order in which imports may point."""
    contracts = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["tool"]["importlinter"][
        "contracts"
    ]
    layers = [re.findall(r"wavefront\.(\w+)", layer) for layer in reversed(contracts[0]["layers"])]
    level = {name: number for number, layer in enumerate(layers) for name in layer}
    table = (ROOT / "docs" / "architecture.md").read_text("utf-8").partition("## Packages")[2]
    rows = [
        re.findall(r"`(\w+)(?:\.py|/)`", row) for row in re.findall(r"^\| (`.*?) \|", table, re.MULTILINE)
    ]
    packages = [[level[name] for name in row] for row in rows if row and row[0] in level]
    files = (ROOT / "wavefront").iterdir()  # folders that have moved may leave their cache behind
    modules = {path.stem for path in files if path.suffix == ".py" or (path / "__init__.py").is_file()}
    assert {name for row in rows for name in row} >= modules - {"__init__", "__pycache__"}
    for below, above in pairwise(packages):
        assert max(below) <= min(above)


def test_the_picture_of_the_loop_has_its_stages():
    """In boxes with the points of features that act after them, and in the words of its description."""
    texts = re.findall(r"<text[^>]*>([^<]*)</text>", (ROOT / "docs" / "way_of_a_ray.svg").read_text("utf-8"))
    words = (ROOT / "docs" / "architecture.md").read_text("utf-8").partition("A wave has the stages ")[2]
    named = re.split(r", | and ", words.partition(", which leads")[0])
    assert named == [stage.__name__ for stage, _ in ORDER]
    for stage, points in ORDER:
        box = texts[texts.index(stage.__name__) :][:3]
        assert not points or box[2] == ", ".join(points), stage.__name__


def test_every_public_name_is_written_about():
    text = "\n".join(document.read_text("utf-8") for document in DOCUMENTS)
    missing = [name for name in wf.__all__ if not re.search(rf"\b{name}\b", text)]
    assert missing == []


def test_names_in_the_documents_exist():
    text = "\n".join(document.read_text("utf-8") for document in DOCUMENTS)
    for dotted in set(re.findall(r"\bwf((?:\.[A-Za-z_]\w*)+)", text)):
        thing = wf
        for part in dotted[1:].split("."):
            assert hasattr(thing, part), f"wf{dotted}"
            thing = getattr(thing, part)


def test_commands_of_the_readme_are_single_lines():
    lines = (ROOT / "README.md").read_text("utf-8").splitlines()
    for name in ("render", "tests"):
        at = lines.index(f"<!-- command: {name} -->")
        assert lines[at + 1] == "```sh"
        assert lines[at + 2].startswith("python3 -m venv .venv && .venv/bin/pip install -q ")
        assert lines[at + 3] == "```"


def test_pictures_are_small_and_are_pictures():
    pictures = sorted(each for each in (ROOT / "docs").glob("**/*.*") if each.suffix in (".png", ".jpg"))
    assert pictures
    for picture in pictures:
        if "generated" in picture.parts:
            continue
        assert picture.stat().st_size < 500_000, picture.name
        begin = b"\x89PNG" if picture.suffix == ".png" else b"\xff\xd8\xff"
        assert picture.read_bytes().startswith(begin), picture.name


def test_cards_of_the_gallery_are_equal_and_lead_to_large_pictures():
    text = (ROOT / "docs" / "gallery.md").read_text("utf-8")
    cards = re.findall(r"\[!\[[^\]]+\]\((cards/[^)]+)\)\]\(([^)]+)\)", text)
    assert len(cards) >= 14
    for card, picture in cards:
        assert wf.Image.load(ROOT / "docs" / card).rgb.shape == (320, 480, 3), card
        if picture.endswith(".jpg"):
            assert wf.Image.load(ROOT / "docs" / picture).rgb.shape[1] >= 1200, picture
    assert wf.Image.load(ROOT / "docs" / "terrace.jpg").rgb.shape[1] == 1920


PICTURE = re.compile(r"!\[([^\]]+)\]\((\S+)\)")


@pytest.mark.parametrize("page", sorted((ROOT / "docs" / "how_to").glob("*.md")), ids=lambda page: page.stem)
def test_a_how_to_page_shows_what_its_code_makes(page):
    """A small picture, described for those who do not see it."""
    shown = PICTURE.findall(page.read_text("utf-8"))
    assert shown
    for _, path in shown:
        picture = page.parent / path
        assert picture.stat().st_size < 60_000, path
        assert wf.Image.load(picture).rgb.std() > 0.02, path


def test_pages_of_classes_have_what_the_classes_inherit():
    """`Spheres.placed` is a method of a base class that is not public."""
    template = (ROOT / "docs" / "_templates" / "autosummary" / "class.rst").read_text("utf-8")
    assert ":inherited-members:" in template
    assert "placed" not in vars(wf.Spheres)
    assert callable(wf.Spheres.placed)


def test_pages_load_nothing_from_other_servers():
    """No diagram that needs a script, and no extension that brings one."""
    settings = (ROOT / "docs" / "conf.py").read_text("utf-8")
    assert "mermaid" not in settings
    for page in PAGES:
        text = page.read_text("utf-8")
        assert "```mermaid" not in text, page.name
        assert not [path for _, path in PICTURE.findall(text) if ":" in path], page.name


def test_the_conventions_hold_for_the_constant_environment():
    """The claim on conventions.md: a floor of reflectance 0.5 in an environment of 1 is 0.5."""
    floor = wf.Rectangle((-1, 0, 1), (2, 0, 0), (0, 0, -2), material=wf.Diffuse(0.5))
    camera = wf.Camera.look_at((0, 1, 0), (0, 0, 0), up=(0, 0, -1), fov=20, size=(8, 8))
    image = wf.render(wf.Scene(floor, [wf.Environment(1)], camera), spp=64, progress=False)
    assert np.abs(image.rgb.mean() - 0.5) < 0.01
