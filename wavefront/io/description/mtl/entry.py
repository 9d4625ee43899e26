"""The lines of a material: keywords with the numbers and images that stand after them."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from ....arrays.vec import Doubles
from ....core.errors import SceneError, exact, passed_limit
from ....textures.image import Texture
from ...losses import Losses
from ...sources import GRAY, SceneFiles
from ...text_lines import NUMBER
from .keywords import CHANNELS, LEFT_OUT, OPTIONS, Kind, is_image, keyword_of, mended, options_read


class Image(NamedTuple):
    """The options and the file of an image, from its line."""

    options: dict[str, list[str]]  # the words of each
    reference: str  # the name of the file, which may contain spaces


@dataclass
class Entry:
    """One material as written: keyword in lower case -> (keyword, line number, the rest of the line)."""

    file: str
    name: str
    lines: dict[str, tuple[str, int, str]] = field(default_factory=dict)
    read: set[str] = field(default_factory=set)  # keywords that the material uses
    idle_options: set[str] = field(default_factory=set)  # options of images that are not honored
    images: dict[str, Any] = field(default_factory=dict)  # arrays, or a `StoredImage`
    files: SceneFiles | None = None  # None where all images were read already
    losses: Losses = field(default_factory=lambda: Losses(""))

    def where(self, key: str) -> str:
        """Return file, line (if there is one) and keyword for a message."""
        keyword, number, _ = self.lines[key]
        return f"{self.file} line {number}: {keyword}" if number else f"{self.file}: {keyword}"

    def note(self, key: str, value: str, done: str) -> None:
        """Note the value of a line that is changed or left out."""
        place, _, keyword = self.where(key).rpartition(": ")
        self.losses.note(keyword, place, value, done)

    def has(self, *keys: str) -> bool:
        """Return whether any of the keywords occurs."""
        return any(key in self.lines for key in keys)

    def leave_out(self, key: str, error: SceneError) -> None:
        """Leave out a line that cannot be read, which is noted."""
        if passed_limit(error):
            raise error
        self.losses.note(str(error).removeprefix(f"{self.where(key)}: "), self.where(key), done=LEFT_OUT)
        del self.lines[key]

    def mend(self) -> None:
        """Replace or leave out lines that are damaged, and read the images."""
        for key in list(self.lines):
            if is_image(key):
                self._mend_image(key)
            elif keyword_of(key).kind is not Kind.UNREAD:
                self._mend_numbers(key)

    def _mend_numbers(self, key: str) -> None:
        keyword, number, rest = self.lines[key]
        better, done = mended(key, rest)
        if done:
            self.note(key, repr(rest), done)
        if better is None:
            del self.lines[key]
        else:
            self.lines[key] = keyword, number, better if done or "xyz" in rest else rest

    def _mend_image(self, key: str) -> None:
        """Read an image, unless that was done; without one the line is left out, or the image gray."""
        image = self.image(key)
        self.idle_options.update(
            f"{option} of {self.lines[key][0]}" for option in image.options.keys() - options_read(key)
        )
        if key in self.images:
            return
        if not image.reference:
            self.note(key, "without a file", LEFT_OUT)
            del self.lines[key]
            return
        files = self.files or SceneFiles(self.file, losses=self.losses)
        try:
            instead = GRAY if key == "map_kd" else None
            picture = files.picture(image.reference, self.file, self.where(key), instead)
        except SceneError as error:
            raise SceneError(f"{self.where(key)}: {error}") from error
        if picture is not None:
            self.images[key] = picture
            return
        del self.lines[key]
        if key == "map_ke":
            self.lines.pop("ke", None)

    def image(self, key: str) -> Image:
        """Return the options and the file name of an image's line."""
        rest = self.lines[key][2]
        options: dict[str, list[str]] = {}
        while rest.startswith("-"):
            option, _, rest = rest.partition(" ")
            words, count = rest.split(), OPTIONS.get(option)
            if count is None:
                count = 0
                while count < 3 and count < len(words) and NUMBER.fullmatch(words[count]):
                    count += 1
            options[option] = words[:count]
            rest = (rest.split(None, count) + [""] * (count + 1))[count].strip()
        return Image(options, rest)

    def numbers(self, key: str) -> list[float] | None:
        """Return the numbers of a line, None if there is no such line."""
        if key not in self.lines:
            return None
        self.read.add(key)
        return [float(word) for word in self.lines[key][2].partition("#")[0].split()]

    def number(self, key: str, default: float) -> float:
        """Return the first number of a line."""
        values = self.numbers(key)
        return default if values is None else values[0]

    def clamped(self, key: str, default: float) -> float:
        """Return a number, clamped to the range of its keyword, which is noted."""
        value, high = self.number(key, default), keyword_of(key).high
        if not 0 <= value <= high:
            self.note(key, exact(value), f"clamped, as it must be in [0, {high:g}]")
        return min(max(value, 0.0), high)

    def color(self, key: str, default: float) -> Doubles:
        """Return a color (3,), clamped to the range of its keyword with a warning."""
        values = self.numbers(key)
        if values is None:
            return np.full(3, default)
        color, high = np.broadcast_to(np.array(values), 3), keyword_of(key).high
        limited = np.clip(color, 0, high)
        if (limited != color).any():
            limit = f"in [0, {high:g}]" if np.isfinite(high) else "at least 0"
            self.note(key, self.lines[key][2], f"clamped, as it must be {limit}")
        return limited

    def texture(self, key: str, scale: Any = 1.0, kind: Kind | None = None) -> Texture | None:
        """Return the texture of an image, by default of the kind of its keyword; None if there is none."""
        if key not in self.lines:
            return None
        kind = kind or keyword_of(key).kind
        options = self.image(key).options
        self.read.add(key)
        base, gain = self._option(key, options, "-mm", [0.0, 1.0])
        transform = self._placing(key, options)
        channel = self._channel(key, options) if kind is Kind.CHANNEL else None
        try:
            return Texture(
                self.images[key],
                srgb=kind is Kind.PICTURE,
                wrap="clamp" if options.get("-clamp") == ["on"] else "repeat",
                transform=transform,
                channel=channel,
                scale=np.asarray(scale) * gain,
                offset=np.asarray(scale) * base,
            )
        except SceneError as error:
            self.leave_out(key, error)
            return None

    def multiplier(self, key: str) -> float:
        """Return the option -bm of an image."""
        return self._option(key, self.image(key).options, "-bm", [1.0])[0]

    def _option(
        self, key: str, options: dict[str, list[str]], name: str, default: list[float]
    ) -> list[float]:
        """Return the numbers of an option; those that are not written are the last of `default`."""
        words = options.get(name, [])
        values = [float(word) for word in words if NUMBER.fullmatch(word)]
        if len(values) < len(words) or not np.isfinite(values).all():
            self.note(key, f"with {name} {' '.join(words)}", "without that option")
            values = []
        return values + default[len(values) :]

    def _placing(self, key: str, options: dict[str, list[str]]) -> Doubles | None:
        """Return the transform (3, 3) of texture coordinates by -s and -o, None without them."""
        if "-s" not in options and "-o" not in options:
            return None
        scale, offset = (
            self._option(key, options, name, [default] * 3) for name, default in (("-s", 1.0), ("-o", 0.0))
        )
        return np.array([[scale[0], 0, offset[0]], [0, scale[1], offset[1]], [0, 0, 1]])

    def _channel(self, key: str, options: dict[str, list[str]]) -> Any:
        """Return the channel of the image by -imfchan: a number, or "luminance".

        By default it is alpha for `map_d`, where there is one, and "luminance".
        """
        has_alpha = key == "map_d" and self.images[key].codes.shape[2] in (2, 4)
        word = options.get("-imfchan", ["m" if has_alpha else "l"])[0]
        if word not in CHANNELS:
            self.note(key, f"with -imfchan {word}", "without that option")
            word = "m" if has_alpha else "l"
        return CHANNELS[word]

    def unread(self) -> list[str]:
        """Return the keywords, as written, that the material does not support."""
        return [keyword for key, (keyword, _, _) in self.lines.items() if not self._is_idle(key)]

    def _is_idle(self, key: str) -> bool:
        keyword = keyword_of(key)
        if key in self.read or keyword.idle:
            return True
        return keyword.neutral is not None and set(self.lines[key][2].split()) <= _spellings(keyword.neutral)


def _spellings(value: float) -> set[str]:
    return {f"{value:.{digits}f}" for digits in range(10)} | {f"{value:g}"}
