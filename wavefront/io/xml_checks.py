"""Checks of XML files before a library reads them: no entities, and a limit for their expanded size."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from xml.parsers import expat

from ..core.errors import LimitError, SceneError

MAX_DEPTH = 128  # nesting of nodes
MAX_EXPANDED = 2**31  # bytes of a file with every reference replaced by its target
NODE_BYTES = 2**11  # bytes that a node counts at least; this limits the number of nodes


def look_through(
    name: str,
    data: bytes | bytearray,
    begin: Callable[[str, dict[str, str], int], None],
    end: Callable[[str, int], None] = lambda tag, at: None,
) -> None:
    """Call `begin` with the tag, the attributes and the byte of every element, and `end` at its end.

    Tags and attributes come without namespaces.

    Raises
    ------
    SceneError
        If the file is not well formed, or has a document type, which could define entities that expand
        or refer to other files.
    """
    parser = expat.ParserCreate(namespace_separator=" ")

    def refuse(*_: object) -> None:
        raise SceneError(
            f"{name} line {parser.CurrentLineNumber}: has a document type; such files are refused"
        )

    def start_element(tag: str, attributes: dict[str, str]) -> None:
        bare = {key.rpartition(" ")[2]: value for key, value in attributes.items()}
        begin(tag.rpartition(" ")[2], bare, parser.CurrentByteIndex)

    parser.StartDoctypeDeclHandler = refuse
    parser.StartElementHandler = start_element
    parser.EndElementHandler = lambda tag: end(tag.rpartition(" ")[2], parser.CurrentByteIndex)
    try:
        parser.Parse(data, True)
    # LookupError: an encoding that Python does not have
    except (expat.ExpatError, LookupError, ValueError) as error:
        if isinstance(error, SceneError):
            raise
        raise SceneError(f"{name}: not a readable file: {error}") from error


def check_expanded(name: str, children: Mapping[str, list[str]], sizes: Mapping[str, int], root: str) -> None:
    """Check the size of a file with all references replaced by their targets; arguments as of `total`.

    Raises
    ------
    SceneError
        If it is too large or too deep, or a node contains itself.
    """
    size = total(name, children, lambda node: sizes.get(node, 0) + NODE_BYTES, root)
    if size > MAX_EXPANDED:
        raise LimitError(
            f"{name}: its nodes refer to each other so often that they stand for {size} bytes; "
            f"the limit is {MAX_EXPANDED}"
        )


def total(name: str, children: Mapping[str, list[str]], count_of: Callable[[str], int], root: str) -> int:
    """Return the sum over all nodes, each counted once for each reference to it.

    Parameters
    ----------
    name
        File name, for messages.
    children
        The nodes that each node refers to or holds; one may occur several times.
    count_of
        Returns the count of a node.
    root
        The node to begin with.

    Raises
    ------
    SceneError
        If the nodes are too deep, or a node contains itself.
    """
    known: dict[str, int] = {}

    def below(node: str, above: tuple[str, ...]) -> int:
        if node in above:
            raise SceneError(f"{name}: node {node!r} holds itself")
        if len(above) >= MAX_DEPTH:
            raise SceneError(f"{name}: its nodes are nested deeper than {MAX_DEPTH}")
        if node not in known:
            counts = (below(child, (*above, node)) for child in children.get(node, []))
            known[node] = count_of(node) + sum(counts)
        return known[node]

    return below(root, ())
