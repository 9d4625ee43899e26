"""The package as a whole: what is public is documented, typed, and quick to import."""

import inspect
import re
import subprocess
import sys
import tomllib
from importlib.metadata import version
from importlib.resources import files
from pathlib import Path

import pytest
from inside import VERSION

import wavefront as wf

ROOT = Path(__file__).parents[2]
PUBLIC = {name: getattr(wf, name) for name in wf.__all__}
LIBRARIES = ("trimesh", "imageio", "PIL", "OpenEXR", "scipy", "embreex", "matplotlib", "tqdm", "numpy.ma")
LAZY = (
    *LIBRARIES,
    "wavefront.io.load",
    "wavefront.image.comparison",
    "wavefront.testing",
    "wavefront.workers.remote",
)


def public_methods():
    """Yield (qualified name, function) of everything that users may call."""
    for name, thing in PUBLIC.items():
        if inspect.isfunction(thing):
            yield name, thing
        elif inspect.isclass(thing):
            yield name, thing
            for attribute, member in vars(thing).items():
                function = member.__func__ if isinstance(member, classmethod | staticmethod) else member
                if not attribute.startswith("_") and inspect.isfunction(function):
                    yield f"{name}.{attribute}", function
    for name in wf.testing.__all__:
        yield f"testing.{name}", getattr(wf.testing, name)


CALLABLES = dict(public_methods())
MADE_OTHERWISE = ("Camera", "Image")
DESCRIBED = {
    "render",
    "load",
    "load_mesh",
    *(f"testing.{name}" for name in wf.testing.__all__ if "_" in name),
}


def parameters(thing):
    """Return the names of the parameters that a user passes."""
    signature = inspect.signature(thing)
    return [name for name in signature.parameters if name not in ("self", "cls")]


def documented(docstring):
    """Return the names that a numpydoc docstring describes as parameters or attributes."""
    names = []
    for section in re.findall(
        r"^(?:Parameters|Attributes)\n-+\n(.*?)(?=^\w[\w ]*\n-+\n|\Z)", docstring, re.MULTILINE | re.DOTALL
    ):
        for heading in re.findall(r"^(\w[\w, ]*)(?: : .*)?$", section, re.MULTILINE):
            names += [name.strip() for name in heading.split(",")]
    return names


def test_parameters_are_described_and_annotated():
    """That public things have docstrings, in which style, and what is annotated inside, ruff and mypy say."""
    for name, thing in CALLABLES.items():
        if getattr(thing, "_is_protocol", False):
            continue  # it has no constructor
        described = documented(inspect.getdoc(thing))
        is_made = (
            inspect.isclass(thing) and not issubclass(thing, BaseException) and name not in MADE_OTHERWISE
        )
        if name in DESCRIBED or (is_made and described):
            assert [p for p in parameters(thing) if p not in described] == [], name
        function = thing.__init__ if inspect.isclass(thing) else thing
        if inspect.isfunction(function):
            signature = inspect.signature(function).parameters
            missing = [p for p in parameters(function) if signature[p].annotation is inspect.Parameter.empty]
            assert missing == [], name


def test_the_version_is_the_same_everywhere():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))
    assert project["tool"]["hatch"]["version"] == {"path": "wavefront/version.py"}
    assert version("wavefront") == VERSION == wf.__version__
    assert VERSION in (ROOT / "CHANGELOG.md").read_text("utf-8")


def test_the_package_says_that_it_is_typed():
    assert files("wavefront").joinpath("py.typed").is_file()


def python(code, *words):
    """Return what a program prints."""
    command = [sys.executable, "-c", code, *words]
    return subprocess.run(command, capture_output=True, text=True, check=True, timeout=60).stdout


def test_a_first_picture_leaves_heavy_modules_alone(tmp_path):
    """Nor does the import; saving it as a png loads what writes pngs, and no more."""
    code = (
        "import sys, wavefront as wf\n"
        f"print([m for m in {LAZY!r} if m in sys.modules])\n"
        "light = wf.Rectangle((-1, 2, -1), (2, 0, 0), (0, 0, 2), emission=3.0)\n"
        "camera = wf.Camera.look_at((0, 1, 5), (0, 0, 0), size=(16, 16))\n"
        "scene = wf.Scene([light, wf.Sphere((0, 0, 0), 1)], camera=camera)\n"
        "image = wf.render(scene, 16, accel='numpy')\n"
        "for name in ('a.npy', 'a.hdr', 'a.png'):\n"
        f"    print([m for m in {LAZY!r} if m in sys.modules])\n"
        "    image.save(sys.argv[1] + name)\n"
        f"print([m for m in {LAZY!r} if m in sys.modules])"
    )
    assert python(code, f"{tmp_path}/").splitlines() == ["[]", "[]", "[]", "[]", "['imageio', 'PIL']"]


def test_scenes_take_what_other_libraries_have():
    """Whatever is asked for first, also where nothing is rendered."""
    code = "import trimesh\nfrom wavefront import Scene\nprint(len(Scene(trimesh.creation.box()).shapes))"
    assert python(code).split() == ["1"]


def test_what_is_imported_later_is_there():
    """By attribute, by `from` and by `dir`; a name that does not exist is an error as in any module."""
    assert {*wf._MODULES, *wf._HOME_OF} == set(wf.__all__)
    assert set(dir(wf)) == set(wf.__all__)
    code = (
        "import wavefront as wf\n"
        "print(wf.testing.__name__, wf.compare.__module__)\n"
        "from wavefront import from_trimesh, load, load_mesh, Comparison, testing\n"
        "print(load.__module__)"
    )
    assert python(code).split() == ["wavefront.testing", "wavefront.image.comparison", "wavefront.io.load"]
    with pytest.raises(AttributeError, match="module 'wavefront' has no attribute 'rendr'"):
        _ = wf.rendr


def test_errors_are_of_the_kinds_that_programs_catch():
    assert issubclass(wf.SceneError, ValueError)
    assert issubclass(wf.SaveError, wf.SceneError)
    assert issubclass(wf.SaveError, OSError)
    assert issubclass(wf.RenderError, RuntimeError)
    assert issubclass(wf.Interrupted, KeyboardInterrupt)
    assert not issubclass(wf.Interrupted, Exception)


def test_python_m_is_the_command():
    done = subprocess.run(
        [sys.executable, "-m", "wavefront", "--version"], capture_output=True, text=True, timeout=60
    )
    assert (done.returncode, done.stdout.strip()) == (0, VERSION)
