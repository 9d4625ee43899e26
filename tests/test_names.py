"""One word has one meaning: names of classes, types, functions and modules stand for one thing each."""

import ast
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

PACKAGE = Path(__file__).parents[1] / "wavefront"

MODULES = {  # what several rooms have under one name, and why
    "__init__": "the room itself",
    "base": "the contract of a room",
    "registry": "the table of a room, and the class of all tables",
    "scene": "what a user puts together, and the same compiled",
    "instances": "their compilation, and their acceleration",
    "image": "the picture, and what is made of an image: a texture, an environment",
    "alpha": "the parameter, and the stage that acts by it",
    "medium": "what a material encloses, and the stage that weakens light by it",
    "sphere": "the shape, its intersection, and the light it makes",
    "triangle": "the intersection of triangles, and the light they make",
    "warp": "the functions, and the check of them",
    "parameter": "attributes that are checked, and the values that textures may take the place of",
}
FUNCTIONS = {
    "parse": "one for each format of scenes, called by the module's name",
    "read": "the same of what several formats share",
    "spec": "the appearance of a material of a format",
    "encode": "one for each format of images",
    "decode": "one for each format of images",
    "tent": "the filter, and the warp that it shifts",
    "gaussian": "the filter, and the warp that it shifts",
}


def modules() -> Iterator[tuple[Path, ast.Module]]:
    for path in sorted(PACKAGE.rglob("*.py")):
        yield path, ast.parse(path.read_text("utf-8"))


def named(node: ast.stmt) -> tuple[str, str] | None:
    """Return the kind and the name of what a statement at the top of a module defines."""
    if isinstance(node, ast.ClassDef):
        return "class", node.name
    if isinstance(node, ast.FunctionDef):
        return "function", node.name
    target = node.targets[0] if isinstance(node, ast.Assign) else getattr(node, "target", None)
    if isinstance(node, ast.Assign | ast.AnnAssign) and isinstance(target, ast.Name):
        made = ast.unparse(node.value.func) if isinstance(node.value, ast.Call) else ""
        if target.id[0].isupper() and not target.id.isupper() and made not in ("TypeVar", "ParamSpec"):
            return "class", target.id
    return None


def places(kind: str) -> dict[str, list[str]]:
    """Return where each public name of a kind is defined."""
    found: dict[str, list[str]] = defaultdict(list)
    for path, tree in modules():
        for node in tree.body:
            match named(node):
                case (which, name) if which == kind and not name.startswith("_"):
                    found[name].append(str(path.relative_to(PACKAGE)))
    return found


def several(found: dict[str, list[str]]) -> dict[str, list[str]]:
    return {name: where for name, where in found.items() if len(where) > 1}


def test_a_class_or_a_type_has_a_name_of_its_own() -> None:
    assert len(places("class")) > 150
    assert several(places("class")) == {}


def test_a_public_function_has_a_name_of_its_own() -> None:
    assert len(places("function")) > 300
    twice = several(places("function"))
    assert {name: where for name, where in twice.items() if name not in FUNCTIONS} == {}
    assert FUNCTIONS.keys() <= twice.keys()  # the list holds nothing that is gone


def test_a_module_has_a_name_of_its_own() -> None:
    found: dict[str, list[str]] = defaultdict(list)
    for path, _ in modules():
        found[path.stem].append(str(path.relative_to(PACKAGE)))
    twice = several(found)
    assert {name: where for name, where in twice.items() if name not in MODULES} == {}
    assert MODULES.keys() <= twice.keys()
