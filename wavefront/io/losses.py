"""What of a scene file is not honored: one warning that names all of it."""

from __future__ import annotations

from .repair import warn


class Losses:
    """Collects what is not honored; the same thing at several places is named once, with their number."""

    def __init__(self) -> None:
        self._places: dict[str, dict[str, None]] = {}

    def note(self, what: str, place: str = "") -> None:
        """Note something, and the file and line where it stands unless `what` says it."""
        self._places.setdefault(what, {})[place] = None

    def report(self, name: str, strict: bool) -> None:
        """Warn of all that was noted in the file `name`.

        Raises
        ------
        SceneError
            If `strict`.
        """
        lines = []
        for what, (first, *more) in self._places.items():
            line = f"{first}: {what}" if first else what
            lines.append(line.removeprefix(name).lstrip(", ") + (f" ({len(more)} more)" if more else ""))
        if lines:
            warn(f"{name}: not honored: {'; '.join(lines)}", strict)
