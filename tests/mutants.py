"""Change a formula in one place, run tests, and list what they let pass.

    python tests/mutants.py --kinds densities
    python tests/mutants.py wavefront/stages/reuse.py --jobs 16

Each mutant is one change of one file. It is made in a process of its own, which is forked where all is
imported already, so that a mutant costs no more than the tests that it fails:

- `constants`: a number times 1.1 (`--by` another factor), or plus 1 if it is an integer; 0 becomes 1 and, in
  a name or a test of equality, stays. Indices, shapes, texts and types are no formulas and are left out.
- `factors`: a product or a quotient without one of its factors, `a *= b` or `a /= b` left out, `-a` as a.
- `densities`: what a function named pdf or pmf returns, or what is assigned to such a name, times that; and
  all of these in one class at once, so that what is returned with a sample agrees with the function.
- `features`: a class of features/ without one of its methods or class attributes, so that those of its base
  class act in their place. Without `of`, no scene has the feature.

The tests of a file stand in `TESTS`; they run with -x, and `--tests` names others. A test that fails kills a
mutant. One with which the module cannot be imported, or the tests cannot be collected, is invalid: it
says nothing about the tests.
"""

from __future__ import annotations

import argparse
import ast
import contextlib
import functools
import os
import signal
import sys
import time
import types
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from wavefront.core.parameter import Parameter

ROOT = Path(__file__).resolve().parent.parent
OURS = str(ROOT / "wavefront"), str(ROOT / "tests")
# the tests that concern a file, quick ones first
LAYERS = ("layers", "metallic", "metal", "gloss", "matte", "clear", "coat", "cloth", "film", "fresnel")
TESTS: dict[str, tuple[str, ...]] = {
    "wavefront/stages/reuse.py": (
        "tests/integrators/test_shared_connections.py",
        "tests/integrators/test_reuse.py",
        "tests/physics/test_equal_means.py",
    ),
    "wavefront/integrators/light_tracing.py": (
        "tests/integrators/test_light_tracing.py",
        "tests/integrators/test_caustics.py",
    ),
    "wavefront/guiding/cells.py": ("tests/guiding/test_guiding.py",),
    "wavefront/guiding/guide_table.py": (
        "tests/guiding/test_guiding.py",
        "tests/properties/test_density_of_tables.py",
    ),
    "wavefront/guiding/octahedral.py": (
        "tests/guiding/test_guiding.py",
        "tests/properties/test_density_of_tables.py",
    ),
    "wavefront/guiding/training.py": ("tests/guiding/test_guiding.py",),
    "wavefront/aovs/geometric.py": (
        "tests/aovs/test_geometric_layers.py",
        "tests/aovs/test_sampled_layers.py",
    ),
    "wavefront/aovs/recorder.py": (
        "tests/integrators/test_clamp.py",
        "tests/aovs/test_sampled_layers.py",
        "tests/denoising/test_denoising.py",
    ),
    **dict.fromkeys(
        (
            "wavefront/bsdfs/plastic.py",
            "wavefront/bsdfs/microfacet.py",
            "wavefront/bsdfs/rough.py",
            "wavefront/bsdfs/energy.py",
        ),
        (
            "tests/bsdfs/test_bsdf_formulas.py",
            "tests/bsdfs/test_energy.py",
            "tests/bsdfs/test_bsdfs.py",
            "tests/bsdfs/test_bsdf_models.py",
            "tests/properties/test_density_of_bsdfs.py",
        ),
    ),
    **dict.fromkeys(
        (
            "wavefront/bsdfs/openpbr.py",
            *(f"wavefront/bsdfs/layers/{name}.py" for name in LAYERS),
        ),
        (
            "tests/bsdfs/test_openpbr.py",
            "tests/bsdfs/test_bsdf_formulas.py",
            "tests/bsdfs/test_bsdfs.py",
            "tests/bsdfs/test_bsdf_models.py",
            "tests/properties/test_density_of_bsdfs.py",
        ),
    ),
    **dict.fromkeys(
        ("wavefront/bsdfs/sheen.py", "wavefront/bsdfs/diffuse_transmission.py"),
        ("tests/bsdfs/test_bsdf_formulas.py", "tests/properties/test_density_of_bsdfs.py"),
    ),
    "wavefront/bsdfs/measured.py": (
        "tests/bsdfs/test_measured.py",
        "tests/properties/test_density_of_bsdfs.py",
    ),
    **dict.fromkeys(
        ("wavefront/bsdfs/disney.py", "wavefront/bsdfs/disney_thin.py", "wavefront/bsdfs/layers/disney.py"),
        (
            "tests/bsdfs/test_disney.py",
            "tests/bsdfs/test_bsdfs.py",
            "tests/bsdfs/test_bsdf_models.py",
            "tests/properties/test_density_of_bsdfs.py",
        ),
    ),
    "wavefront/bsdfs/channels.py": ("tests/bsdfs/test_channels.py",),
    "wavefront/bsdfs/thin_film.py": ("tests/bsdfs/test_thin_film.py",),
    "wavefront/film/light_sums.py": ("tests/integrators/test_caustics.py",),
    "wavefront/lights/spot.py": (
        "tests/lights/test_spot.py",
        "tests/lights/test_projector.py",
        "tests/properties/test_density_of_lights.py",
    ),
    "wavefront/lights/projector.py": ("tests/lights/test_projector.py", "tests/lights/test_spot.py"),
    "wavefront/stages/normal_mapping.py": (
        "tests/textures/test_folded_scattering.py",
        "tests/textures/test_normal_maps.py",
    ),
    **dict.fromkeys(
        ("wavefront/accel/distance_grid.py", "wavefront/shapes/distance_grid.py"),
        ("tests/accel/test_distance_grid.py",),
    ),
    "wavefront/lights/glow.py": ("tests/lights/test_glow.py",),
    "wavefront/lights/ies.py": ("tests/properties/test_density_of_lights.py", "tests/lights/test_ies.py"),
    "wavefront/lights/table.py": ("tests/properties/test_density_of_lights.py",),
}
FORMULAS = tuple(TESTS)
# files with densities
DENSITIES = (
    "wavefront/sampling/warp.py",
    "wavefront/sampling/spherical.py",
    "wavefront/sampling/discrete.py",
    "wavefront/bsdfs/base.py",
    "wavefront/bsdfs/channels.py",
    "wavefront/bsdfs/conductor.py",
    "wavefront/bsdfs/dielectric.py",
    "wavefront/bsdfs/diffuse.py",
    "wavefront/bsdfs/diffuse_transmission.py",
    "wavefront/bsdfs/disney.py",
    "wavefront/bsdfs/disney_thin.py",
    "wavefront/bsdfs/energy.py",
    *(f"wavefront/bsdfs/layers/{name}.py" for name in (*LAYERS, "disney")),
    "wavefront/bsdfs/measured.py",
    "wavefront/bsdfs/microfacet.py",
    "wavefront/bsdfs/mirror.py",
    "wavefront/bsdfs/mix.py",
    "wavefront/bsdfs/openpbr.py",
    "wavefront/bsdfs/oren_nayar.py",
    "wavefront/bsdfs/plastic.py",
    "wavefront/bsdfs/principled.py",
    "wavefront/bsdfs/sheen.py",
    "wavefront/bsdfs/sides.py",
    "wavefront/bsdfs/thin.py",
    "wavefront/guiding/guide_table.py",
    "wavefront/lights/base.py",
    "wavefront/lights/directional.py",
    "wavefront/lights/environment.py",
    "wavefront/lights/glow.py",
    "wavefront/lights/grid.py",
    "wavefront/lights/ies.py",
    "wavefront/lights/image.py",
    "wavefront/lights/infinite.py",
    "wavefront/lights/planar.py",
    "wavefront/lights/point.py",
    "wavefront/lights/product.py",
    "wavefront/lights/rectangle.py",
    "wavefront/lights/samplers.py",
    "wavefront/lights/sky.py",
    "wavefront/lights/sphere.py",
    "wavefront/lights/spot.py",
    "wavefront/lights/table.py",
    "wavefront/lights/tree.py",
    "wavefront/lights/triangle.py",
)
CHOICES = ("grid.py", "samplers.py", "tree.py")  # of one light among many
TESTS |= {
    file: (f"tests/properties/test_density_of_{of}.py",)
    for file in DENSITIES
    if file not in TESTS
    for of in (
        *["bsdfs"] * ("/bsdfs/" in file),
        *["tables"] * file.endswith(("discrete.py", *CHOICES)),
        *["warps"] * file.endswith(("warp.py", "spherical.py")),
        *["lights"] * ("/lights/" in file and not file.endswith(CHOICES)),
    )
}
# for each file of features/, tests beside those of their order
TESTS_OF_FEATURES = {
    "absorption": "materials/test_absorption.py",
    "alpha": "materials/test_alpha.py",
    "background": "scene/test_background.py",
    "black_lights": "scene/test_scene.py",
    "branches": "integrators/test_branches.py",
    "caustics": "integrators/test_light_tracing.py",
    "compiling": "scene/test_scene.py",
    "dispersion": "bsdfs/test_channels.py",
    "guide": "guiding",
    "instances": "shapes/test_instances.py",
    "interpolation": "scene/test_scene.py",
    "media": "media/test_media.py",
    "motion": "motion/test_held_places.py "
    "motion/test_motion_blur.py::test_blurred_picture_is_the_mean_of_stills",
    "nested": "media/test_media.py",
    "normal_maps": "textures/test_normal_maps.py",
    "passing": "materials/test_alpha.py",
    "receivers": "lights/test_receivers.py",
    "shadow_catchers": "bsdfs/test_shadow_catcher.py",
    "shadow_terminator": "features/test_shadow_terminator.py",
    "unseen": "materials/test_visible_to_camera.py",
    "view": "physics/test_equal_means.py",
}
TESTS |= {
    f"wavefront/features/{name}.py": (
        "tests/features/test_order.py",
        *(f"tests/{each}" for each in tests.split()),
    )
    for name, tests in TESTS_OF_FEATURES.items()
}
FILES_OF = {
    "densities": DENSITIES,
    "features": [f"wavefront/features/{name}.py" for name in TESTS_OF_FEATURES],
}
UNUSABLE = 6  # status of a mutant that cannot be imported, beside those of pytest
CONSTANTS = (bool, int, float, str, tuple, list, dict, np.generic, np.ndarray)
DENSITY_NAMES = ("pdf", "pmf", "density", "chance", "mixed")


@dataclass(frozen=True)
class Mutant:
    """One change of a file, or several: the bytes from `start` to `end` become `new`."""

    file: str
    line: int
    edits: tuple[tuple[int, int, str], ...]  # start, end, new
    what: str

    def applied(self, data: bytes) -> bytes:
        """Return the file with the changes."""
        for start, end, new in sorted(self.edits, reverse=True):
            data = data[:start] + new.encode() + data[end:]
        return data


class Finder(ast.NodeVisitor):
    """Collects the mutants of a file."""

    def __init__(self, file: str, source: str, kinds: set[str], by: float) -> None:
        self.file, self.kinds, self.by = file, kinds, by
        self.lines = source.encode().splitlines(keepends=True)
        self.begins = [0]
        for line in self.lines:
            self.begins.append(self.begins[-1] + len(line))
        self.data = source.encode()
        self.found: list[Mutant] = []
        self.functions: list[str] = []

    def add(self, node: ast.AST, new: str, what: str) -> None:
        start = self.begins[node.lineno - 1] + node.col_offset  # type: ignore[attr-defined]
        end = self.begins[node.end_lineno - 1] + node.end_col_offset  # type: ignore[attr-defined]
        self.found.append(Mutant(self.file, node.lineno, ((start, end, new),), what))  # type: ignore[attr-defined]

    def scale(self, node: ast.AST, what: str) -> None:
        if self.text(node).startswith(("np.zeros", "np.empty")):  # what is to be filled, or 0
            return
        self.add(node, f"(({self.text(node)}) * np.float32({self.by}))", f"{what} x {self.by}")

    def text(self, node: ast.AST) -> str:
        return ast.get_source_segment(self.data.decode(), node) or ""

    def visit_FunctionDef(self, node: ast.FunctionDef) -> None:
        self.functions.append(node.name)
        for statement in node.body:
            self.visit(statement)
        self.functions.pop()

    def visit_ClassDef(self, node: ast.ClassDef) -> None:
        before = len(self.found)
        for statement in node.body:
            self.visit(statement)
            if "features" in self.kinds:
                self.leave_out(statement, node.name)
        # in functions that return a density the values on the way to it would be scaled twice
        parts = [each for each in self.found[before:] if "()" in each.what or "sample" in each.what]
        if "densities" in self.kinds and len(parts) > 1:
            edits = tuple(edit for part in parts for edit in part.edits)
            self.found.append(
                Mutant(self.file, node.lineno, edits, f"all densities of {node.name} x {self.by}")
            )

    def leave_out(self, statement: ast.stmt, of: str) -> None:
        """Leave a method or an attribute out of a class, but for what Python itself asks for."""
        if isinstance(statement, ast.FunctionDef):
            first, name = (statement.decorator_list or [statement])[0], statement.name
        elif isinstance(statement, ast.Assign):
            first, name = statement, self.text(statement.targets[0])
        else:
            return
        if not name.startswith("_"):
            start = (
                self.begins[first.lineno - 1]
                + len(self.lines[first.lineno - 1])
                - len(self.lines[first.lineno - 1].lstrip())
            )
            end = self.begins[statement.end_lineno - 1] + statement.end_col_offset
            self.found.append(
                Mutant(self.file, statement.lineno, ((start, end, "pass"),), f"{of}.{name} left out")
            )

    def visit_AnnAssign(self, node: ast.AnnAssign) -> None:
        if node.value is not None:
            self.visit(node.value)

    def visit_Expr(self, node: ast.Expr) -> None:
        if not isinstance(node.value, ast.Constant):  # docstrings
            self.generic_visit(node)

    def visit_Subscript(self, node: ast.Subscript) -> None:
        self.visit(node.value)  # not the index

    def visit_Raise(self, node: ast.Raise) -> None:
        """Leave messages out."""

    def visit_keyword(self, node: ast.keyword) -> None:
        if node.arg not in ("axis", "maxsize", "ndim"):
            self.visit(node.value)

    def visit_Call(self, node: ast.Call) -> None:
        name = self.text(node.func)
        self.visit(node.func)
        for argument in node.args:
            inner = argument.operand if isinstance(argument, ast.UnaryOp) else argument
            whole = isinstance(inner, ast.Constant) and isinstance(inner.value, int)
            shape = name.rpartition(".")[2] in (
                *("reshape", "take", "concatenate", "stack", "repeat", "sum", "mean", "any", "all", "max"),
                *("min", "moveaxis", "swapaxes", "transpose", "argmax", "argmin", "cumsum"),
            )
            if not (whole and shape):  # an axis or a shape
                self.visit(argument)
        for keyword in node.keywords:
            self.visit(keyword)

    def visit_Constant(self, node: ast.Constant) -> None:
        value = node.value
        if "constants" not in self.kinds or isinstance(value, bool) or not isinstance(value, int | float):
            return
        new = repr(value + 1) if isinstance(value, int) else repr(value * self.by) if value else "1.0"
        self.add(node, f"({new})", f"{self.text(node)} -> {new}")

    def visit_BinOp(self, node: ast.BinOp) -> None:
        if "factors" in self.kinds and isinstance(node.op, ast.Mult | ast.Div | ast.FloorDiv | ast.MatMult):
            whole, left, right = self.text(node), self.text(node.left), self.text(node.right)
            self.add(node, f"({left})", f"{_short(whole)} -> {_short(left)}")
            if left in ("1", "f4(1)", "1.0"):
                pass
            elif isinstance(node.op, ast.Mult):
                self.add(node, f"({right})", f"{_short(whole)} -> {_short(right)}")
            else:
                self.add(node, f"(1 / ({right}))", f"{_short(whole)} -> 1 / {_short(right)}")
        self.generic_visit(node)

    def visit_UnaryOp(self, node: ast.UnaryOp) -> None:
        if (
            "factors" in self.kinds
            and isinstance(node.op, ast.USub)
            and not isinstance(node.operand, ast.Constant)
        ):
            self.add(node, f"({self.text(node.operand)})", f"{_short(self.text(node))} without its sign")
        self.generic_visit(node)

    def visit_AugAssign(self, node: ast.AugAssign) -> None:
        if "factors" in self.kinds and isinstance(node.op, ast.Mult | ast.Div):
            self.add(node, "pass", f"{_short(self.text(node))} left out")
        self.visit(node.value)

    def visit_Assign(self, node: ast.Assign) -> None:
        (target,) = node.targets[:1]
        name = self.text(target)
        if "densities" in self.kinds and not isinstance(target, ast.Tuple) and _is_density(name):
            inside = self.functions[-1] if self.functions else "class"
            self.scale(node.value, f"{name} in {inside}")
        self.visit(node.value)

    def visit_Return(self, node: ast.Return) -> None:
        value, name = node.value, self.functions[-1] if self.functions else ""
        if "densities" in self.kinds and value is not None:
            if _is_density(name) and not isinstance(value, ast.Tuple):
                self.scale(value, f"{name}()")
            elif name == "evaluate" and isinstance(value, ast.Tuple):
                self.scale(value.elts[1], "pdf of evaluate()")
        if value is not None:
            self.visit(value)


def _is_density(name: str) -> bool:
    return bool(set(DENSITY_NAMES) & set(name.split("[")[0].rpartition(".")[2].split("_")))


def _short(text: str) -> str:
    text = " ".join(text.split())
    return text if len(text) < 60 else text[:40] + " … " + text[-16:]


def mutants_of(file: str, kinds: set[str], by: float) -> Iterator[Mutant]:
    """Yield the mutants of a file, those of one place side by side."""
    source = (ROOT / file).read_text()
    finder = Finder(file, source, kinds, by)
    finder.visit(ast.parse(source))
    for mutant in sorted(finder.found, key=lambda each: each.edits):
        try:
            compile(mutant.applied(finder.data), file, "exec")
        except SyntaxError:
            continue
        yield mutant


def apply(mutant: Mutant) -> None:
    """Change the module in this process, where everybody has imported it already.

    The code of its functions and methods is replaced in the function objects, and its constants in all
    modules that have taken them by name.
    """
    name = mutant.file.removesuffix(".py").replace("/", ".")
    module = sys.modules[name]
    fresh = types.ModuleType(name)
    fresh.__dict__.update(__file__=module.__file__, __package__=module.__package__)
    sys.modules[name] = fresh  # `@dataclass` looks it up
    exec(compile(mutant.applied((ROOT / mutant.file).read_bytes()), mutant.file, "exec"), vars(fresh))
    sys.modules[name] = module
    for key, new in vars(fresh).items():
        old = vars(module).get(key)
        if key.startswith("__") or old is None or isinstance(new, types.ModuleType):
            continue
        if isinstance(new, type | types.FunctionType) or hasattr(new, "cache_clear"):
            if new.__module__ != name:
                continue
            _replace_code(old, new)
        elif isinstance(old, functools.partial):
            old.__setstate__(new.__reduce__()[2])
        elif isinstance(old, CONSTANTS):
            for other in list(sys.modules.values()):
                if other is not None and getattr(other, "__dict__", {}).get(key) is old:
                    setattr(other, key, new)

    for module in list(sys.modules.values()):  # what the unchanged tests have left in caches
        if (getattr(module, "__file__", None) or "").startswith(OURS):
            for value in list(vars(module).values()):
                if hasattr(value, "cache_clear"):
                    value.cache_clear()


def _replace_code(old: Any, new: Any) -> None:
    """Let a function, or all methods of a class, do what another does."""
    if isinstance(old, type):
        for key in vars(old).keys() - vars(new).keys():
            delattr(old, key)
        for key, value in vars(new).items():
            if key in vars(old):
                if isinstance(_function(value), types.FunctionType):
                    _replace_code(vars(old)[key], value)
                elif isinstance(value, CONSTANTS) and not key.startswith("__"):
                    setattr(old, key, value)
                elif isinstance(value, Parameter):
                    vars(old)[key].convert = value.convert
        return
    function, changed = _function(old), _function(new)
    if isinstance(function, types.FunctionType) and isinstance(changed, types.FunctionType):
        function.__code__ = changed.__code__
        function.__defaults__, function.__kwdefaults__ = changed.__defaults__, changed.__kwdefaults__


def _function(value: Any) -> Any:
    """Return the function in a method, a property or a cache."""
    for name in ("__func__", "fget", "__wrapped__"):
        value = getattr(value, name, value)
    return value


def run_tests(tests: list[str]) -> tuple[int, str]:
    """Run tests in this process; return the exit status and the first test that failed."""
    failed = []

    class Watch:
        def pytest_runtest_logreport(self, report: Any) -> None:
            if report.failed:
                failed.append(report.nodeid)

        def pytest_collectreport(self, report: Any) -> None:
            if report.failed:
                failed.append(report.nodeid)

    options = ["-q", "-x", "-p", "no:cacheprovider", "-p", "no:xdist", "--tb=no", "--no-summary"]
    with open(os.devnull, "w") as nothing, contextlib.redirect_stdout(nothing):
        status = pytest.main(
            [*options, "--rootdir", str(ROOT), *(str(ROOT / test) for test in tests)], [Watch()]
        )
    return int(status), failed[0] if failed else ""


class Child:
    """A process of its own, in which one mutant meets its tests."""

    def __init__(self, mutant: Mutant, tests: list[str], limit: float) -> None:
        self.mutant, self.begin, self.limit = mutant, time.perf_counter(), limit
        self.end, answer = os.pipe()
        self.pid = os.fork()
        if self.pid:
            os.close(answer)
            return
        status, by = UNUSABLE, "cannot be imported"
        try:
            os.setsid()  # its workers end with it
            quiet = os.open(os.devnull, os.O_WRONLY)
            os.dup2(quiet, 1)
            os.dup2(quiet, 2)
            apply(mutant)
            status, by = run_tests(tests)
        finally:
            os.write(answer, f"{status} {by}"[:4000].encode())
            os._exit(0)

    def result(self) -> tuple[str, float, str] | None:
        """Return what came of it, the seconds, and the first test that failed; None while it runs.

        A process that crashes is killed: no test can pass in it.
        """
        seconds = time.perf_counter() - self.begin
        slow = seconds > self.limit
        if slow:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(self.pid, signal.SIGKILL)
        done, _ = os.waitpid(self.pid, 0 if slow else os.WNOHANG)
        if not done:
            return None
        status, _, by = os.read(self.end, 4096).decode().partition(" ")
        os.close(self.end)
        if slow:
            return "too slow", seconds, ""
        known = {"0": "survived", str(int(pytest.ExitCode.TESTS_FAILED)): "killed", "": "killed"}
        return known.get(status, "invalid"), seconds, by


def main() -> int:
    """Run the mutants, print each that is not killed, and the counts."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("files", nargs="*", help="of the package; by default those of TESTS")
    parser.add_argument("--kinds", default="constants,factors")
    parser.add_argument("--by", type=float, default=1.1, help="factor of constants and densities")
    parser.add_argument("--tests", nargs="+", help="in place of those of each file")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--limit", type=float, default=180.0, help="seconds for one mutant")
    parser.add_argument("--seconds", type=float, default=float("inf"), help="after which no mutant begins")
    parser.add_argument("--from-line", type=int, default=0)
    parser.add_argument("--part", default="0/1", help="k/n: every n-th mutant, from the k-th on")
    parser.add_argument("--list", action="store_true", help="print the mutants and run nothing")
    parser.add_argument("--verbose", action="store_true", help="print those that are killed, too")
    given = parser.parse_args()
    kinds = set(given.kinds.split(","))
    files = given.files or (FILES_OF.get(given.kinds, FORMULAS))
    first, step = (int(each) for each in given.part.split("/"))
    mutants = [mutant for file in files for mutant in mutants_of(file, kinds, given.by)]
    mutants = [mutant for mutant in mutants if mutant.line >= given.from_line][first::step]
    if given.list:
        for mutant in mutants:
            print(f"{mutant.file}:{mutant.line}: {mutant.what}")
        print(len(mutants), "mutants")
        return 0
    begin = time.perf_counter()
    counts = dict.fromkeys(("killed", "survived", "too slow", "invalid", "not run"), 0)
    os.environ["HYPOTHESIS_PROFILE"] = "mutants"
    os.chdir(ROOT)
    running: list[Child] = []

    def collect(most: int) -> None:
        while len(running) > most:
            time.sleep(0.02)
            for child in list(running):
                result = child.result()
                if result is None:
                    continue
                running.remove(child)
                state, seconds, by = result
                counts[state] += 1
                if state != "killed" or given.verbose:
                    where = f"{child.mutant.file}:{child.mutant.line}: {child.mutant.what}"
                    print(f"{state} ({seconds:.0f} s): {where} {by}", flush=True)

    known: set[tuple[str, ...]] = set()
    for mutant in mutants:
        tests = tuple(given.tests or TESTS[mutant.file])
        if tests not in known:  # also imports all that is needed
            collect(0)
            start = time.perf_counter()
            status, by = run_tests(list(tests))
            print(f"unchanged, {' '.join(tests)}: {time.perf_counter() - start:.0f} s {by}", flush=True)
            if status:
                return 1
            same = Child(Mutant(mutant.file, 0, (), "nothing"), list(tests), 10 * given.limit)
            while (result := same.result()) is None:
                time.sleep(0.02)
            if result[0] != "survived":
                print(f"the mechanism itself fails tests: {result}")
                return 1
            known.add(tests)
        if time.perf_counter() - begin > given.seconds:
            counts["not run"] += 1
            continue
        collect(given.jobs - 1)
        running.append(Child(mutant, list(tests), given.limit))
    collect(0)
    print(", ".join(f"{count} {state}" for state, count in counts.items()))
    return int(counts["survived"] > 0)


if __name__ == "__main__":
    raise SystemExit(main())
