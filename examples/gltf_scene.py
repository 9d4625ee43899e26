"""A glTF scene: written here byte by byte, read by `wf.load`, and rendered with its own camera and lights.

python examples/gltf_scene.py [out.png] [--spp 128] [--size 640]

The file is kept beside the picture, as out.glb. It holds an urn with textures of color, metalness and
roughness, a pillar that seven nodes share, a lattice cut out by an alpha mask, a ball of green glass, a
panel that shines, a spot light, and a perspective camera. All of it is honored.
"""

from __future__ import annotations

import argparse
import json
import struct
import zlib
from pathlib import Path
from typing import Any

import numpy as np

import wavefront as wf

FLOAT, UNSIGNED = 5126, 5125  # glTF's codes for the types of numbers
KINDS = {1: "SCALAR", 2: "VEC2", 3: "VEC3"}


class Glb:
    """A glTF file in the making: its JSON, and the bytes that this refers to."""

    def __init__(self) -> None:
        self.json: dict[str, Any] = {"asset": {"version": "2.0"}, "scene": 0, "nodes": []}
        self.binary = b""

    def add(self, kind: str, item: dict[str, Any]) -> int:
        """Append an item to one of the lists of the JSON; return its number."""
        items = self.json.setdefault(kind, [])
        items.append(item)
        return len(items) - 1

    def view(self, data: bytes) -> int:
        """Append bytes, at a multiple of four; return the number of their buffer view."""
        place = {"buffer": 0, "byteOffset": len(self.binary), "byteLength": len(data)}
        self.binary += data + bytes(-len(data) % 4)
        return self.add("bufferViews", place)

    def accessor(self, values: np.ndarray) -> int:
        """Append numbers, (n,) indices or (n, 2) or (n, 3) floats; return the number of their accessor."""
        whole = values.dtype.kind in "iu"
        values = values.astype(np.uint32 if whole else np.float32).reshape(len(values), -1)
        item = {"bufferView": self.view(values.tobytes()), "componentType": UNSIGNED if whole else FLOAT}
        limits = {"min": values.min(0).tolist(), "max": values.max(0).tolist()}
        return self.add("accessors", item | {"count": len(values), "type": KINDS[values.shape[1]]} | limits)

    def texture(self, codes: np.ndarray) -> dict[str, int]:
        """Append an image (H, W, 3 or 4) of bytes as a texture; return what a material says of it."""
        image = self.add("images", {"bufferView": self.view(png(codes)), "mimeType": "image/png"})
        return {"index": self.add("textures", {"source": image})}

    def mesh(self, surface: tuple[np.ndarray, ...], material: dict[str, Any]) -> int:
        """Append a mesh of one material; return its number."""
        names = ("POSITION", "NORMAL", "TEXCOORD_0")
        attributes = {name: self.accessor(values) for name, values in zip(names, surface[:3], strict=True)}
        part = {"attributes": attributes, "indices": self.accessor(surface[3].ravel())}
        return self.add("meshes", {"primitives": [part | {"material": self.add("materials", material)}]})

    def write(self, path: Path) -> None:
        """Write the file: a header, the JSON and the bytes."""
        self.json["scenes"] = [{"nodes": list(range(len(self.json["nodes"])))}]
        self.json["buffers"] = [{"byteLength": len(self.binary)}]
        used = {name for material in self.json["materials"] for name in material.get("extensions", {})}
        self.json["extensionsUsed"] = sorted(used | set(self.json.get("extensions", {})))
        text = json.dumps(self.json).encode()
        text += b" " * (-len(text) % 4)
        body = struct.pack("<I4s", len(text), b"JSON") + text
        body += struct.pack("<I4s", len(self.binary), b"BIN\0") + self.binary
        path.write_bytes(b"glTF" + struct.pack("<II", 2, 12 + len(body)) + body)


def png(codes: np.ndarray) -> bytes:
    """Return an image (H, W, 3 or 4) of bytes as a PNG."""
    height, width, channels = codes.shape
    rows = np.zeros((height, 1 + width * channels), np.uint8)  # each begins with its filter: none
    rows[:, 1:] = codes.reshape(height, -1)
    header = struct.pack(">2I5B", width, height, 8, {3: 2, 4: 6}[channels], 0, 0, 0)
    out = b"\x89PNG\r\n\x1a\n"
    for kind, data in ((b"IHDR", header), (b"IDAT", zlib.compress(rows.tobytes())), (b"IEND", b"")):
        out += struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
    return out


def turned(radius: np.ndarray, height: np.ndarray, around: int = 128) -> tuple[np.ndarray, ...]:
    """Return a profile turned about the y axis: positions, normals, texture coordinates, faces."""
    angle = np.linspace(0, 2 * np.pi, around + 1)
    c, s = np.cos(angle)[:, None], np.sin(angle)[:, None]
    positions = np.stack([radius * s, height + 0 * c, radius * c], 2)
    out, up = np.gradient(height), -np.gradient(radius)
    size = np.hypot(out, up)
    normals = np.stack([out / size * s, up / size + 0 * c, out / size * c], 2)
    v = np.linspace(1, 0, len(height))  # glTF counts v downwards
    uvs = np.stack(np.broadcast_arrays(angle[:, None] / (2 * np.pi), v), 2)
    low = (np.arange(around)[:, None] * len(height) + np.arange(len(height) - 1)).ravel()
    right = low + len(height)
    lower, upper = np.stack([low, right, right + 1], 1), np.stack([low, right + 1, low + 1], 1)
    wide = np.tile(radius > 1e-6, around + 1)  # at a pole one of the two has no area
    faces = np.concatenate([lower[wide[low]], upper[wide[low + 1]]])
    return positions.reshape(-1, 3), normals.reshape(-1, 3), uvs.reshape(-1, 2), faces


def sheet(width: float, height: float, repeat: float = 1) -> tuple[np.ndarray, ...]:
    """Return a rectangle around the origin that faces +z: positions, normals, texture coordinates, faces."""
    unit = np.array([[0.0, 1], [1, 1], [1, 0], [0, 0]])
    positions = np.column_stack([(unit[:, 0] - 0.5) * width, (0.5 - unit[:, 1]) * height, np.zeros(4)])
    return positions, np.tile([0.0, 0, 1], (4, 1)), repeat * unit, np.array([[0, 1, 2], [0, 2, 3]])


def facing(direction: tuple[float, float, float], at: tuple[float, float, float]) -> list[float]:
    """Return the matrix, as glTF lists it, of a node at a place whose z axis points in a direction."""
    z = np.array(direction) / np.linalg.norm(direction)
    x = np.cross((0, 1, 0) if abs(z[1]) < 0.99 else (0, 0, -1), z)
    x /= np.linalg.norm(x)
    return np.array([[*x, 0], [*np.cross(z, x), 0], [*z, 0], [*at, 1]]).ravel().tolist()


def codes(values: np.ndarray) -> np.ndarray:
    """Return values in [0, 1] as bytes."""
    return np.round(np.clip(values, 0, 1) * 255).astype(np.uint8)


def urn(glb: Glb) -> int:
    """Add an urn of blue glaze with gilded bands and a gilded pattern; return its mesh."""
    height = np.linspace(0, 1, 97)
    belly = 0.16 + 0.5 * np.sin(np.pi * np.clip(0.08 + 0.8 * height, 0, 1)) ** 1.6
    lip = 0.1 * np.exp(-(((height - 1) / 0.05) ** 2))
    u, v = np.meshgrid((np.arange(1536) + 0.5) / 1536, (np.arange(512) + 0.5) / 512)
    bands = [np.abs(v - 0.2) - 0.02, np.abs(v - 0.72) - 0.02, v - 0.05, 0.95 - v]
    steep = np.hypot(1, 2.7 * np.cos(2 * np.pi * 8 * u))  # so that the lines are equally wide everywhere
    waves = [np.abs(v - 0.46 - 0.13 * side * np.sin(2 * np.pi * 8 * u)) / steep - 0.014 for side in (-1, 1)]
    outside = np.min([*bands, *waves], axis=0)  # distance from what is gilded
    gold = np.clip(0.5 - 512 * outside, 0, 1)[:, :, None]  # an edge is one texel wide, not a stair
    base = (0.08, 0.2, 0.5) + gold * np.array((0.92, 0.64, -0.04))  # sRGB
    metallic_roughness = (0.0, 0.12, 0.0) + gold * np.array((0.0, 0.18, 1.0))  # green and blue hold them
    material = {
        "pbrMetallicRoughness": {
            "baseColorTexture": glb.texture(codes(base)),
            "metallicRoughnessTexture": glb.texture(codes(metallic_roughness)),
        },
        "doubleSided": True,
    }
    return glb.mesh(turned(belly + lip, 1.6 * height), material)


def lattice(glb: Glb) -> int:
    """Add a wooden screen whose holes are cut out by the alpha of its color; return its mesh."""
    x, y = np.meshgrid((np.arange(256) + 0.5) / 256, (np.arange(256) + 0.5) / 256)
    outside = np.minimum(np.abs((x + y) % 1 - 0.5), np.abs((x - y) % 1 - 0.5)) - 0.13
    bars = np.clip(0.5 - 32 * outside, 0, 1)  # a ramp, which the mask's cutoff cuts between the texels
    wood = np.array([0.52, 0.33, 0.2]) * (0.9 + 0.1 * np.sin(40 * x + 6 * np.sin(5 * y)))[:, :, None]
    material = {
        "pbrMetallicRoughness": {
            "baseColorTexture": glb.texture(codes(np.dstack([wood, bars]))),
            "metallicFactor": 0,
            "roughnessFactor": 0.6,
        },
        "alphaMode": "MASK",
        "doubleSided": True,
    }
    return glb.mesh(sheet(2.2, 2.2, 5), material)


def glass_ball(glb: Glb) -> int:
    """Add a ball of green glass of radius 1; return its mesh."""
    angle = np.linspace(-np.pi / 2, np.pi / 2, 65)
    extensions = {
        "KHR_materials_transmission": {"transmissionFactor": 1},
        "KHR_materials_ior": {"ior": 1.5},
        "KHR_materials_volume": {
            "thicknessFactor": 1,
            "attenuationColor": [0.35, 0.8, 0.45],
            "attenuationDistance": 0.8,
        },
    }
    plain = {"metallicFactor": 0, "roughnessFactor": 0}
    return glb.mesh(
        turned(np.cos(angle), np.sin(angle), 96), {"pbrMetallicRoughness": plain, "extensions": extensions}
    )


def pillar(glb: Glb) -> int:
    """Add a white pillar, wide at both ends; return its mesh."""
    height = np.linspace(0, 1, 65)
    flare = 0.09 * (np.exp(-((height / 0.06) ** 2)) + np.exp(-(((1 - height) / 0.06) ** 2)))
    plain = {"baseColorFactor": [0.75, 0.73, 0.7, 1], "metallicFactor": 0, "roughnessFactor": 0.7}
    return glb.mesh(turned(0.15 + flare, 2.4 * height, 64), {"pbrMetallicRoughness": plain})


def floor(glb: Glb) -> int:
    """Add a floor of polished tiles; return its mesh."""
    tiles = np.indices((2, 2)).sum(0) % 2
    colors = np.where(tiles[:, :, None], (0.75, 0.72, 0.68), (0.42, 0.4, 0.39))
    material = {
        "pbrMetallicRoughness": {
            "baseColorTexture": glb.texture(codes(np.kron(colors, np.ones((32, 32, 1))))),
            "metallicFactor": 0,
            "roughnessFactor": 0.25,
        }
    }
    return glb.mesh(sheet(16, 16, 10), material)


def wall(glb: Glb) -> int:
    """Add a plain wall; return its mesh."""
    plain = {"baseColorFactor": [0.5, 0.42, 0.36, 1], "metallicFactor": 0, "roughnessFactor": 0.9}
    return glb.mesh(sheet(16, 8), {"pbrMetallicRoughness": plain})


def panel(glb: Glb) -> int:
    """Add a panel that shines warmly on one side; return its mesh."""
    material = {
        "pbrMetallicRoughness": {"baseColorFactor": [0, 0, 0, 1]},
        "emissiveFactor": [1, 0.8, 0.55],
        "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 11}},
    }
    return glb.mesh(sheet(2.4, 2.4), material)


def write(path: Path) -> None:
    """Write the scene: nodes place what the functions above add."""
    glb = Glb()
    glb.add("nodes", {"mesh": floor(glb), "matrix": facing((0, 1, 0), (0, 0, 0))})
    glb.add("nodes", {"mesh": wall(glb), "translation": [0, 4, -4]})
    glb.add("nodes", {"mesh": urn(glb), "translation": [-0.2, 0, 0.2]})
    glb.add("nodes", {"mesh": glass_ball(glb), "translation": [1.1, 0.42, 0.9], "scale": [0.42] * 3})
    glb.add("nodes", {"mesh": lattice(glb), "matrix": facing((0.55, 0, 1), (-1.9, 1.1, -0.1))})
    glb.add("nodes", {"mesh": panel(glb), "matrix": facing((-0.7, -1, -0.3), (3.2, 4.2, 2.2))})
    column = pillar(glb)
    for k in range(7):
        angle = np.radians(-60 + 20 * k)
        place = [3.3 * np.sin(angle), 0, 0.6 - 3.3 * np.cos(angle)]
        glb.add("nodes", {"mesh": column, "translation": place})
    spot = {"type": "spot", "color": [0.75, 0.88, 1], "intensity": 150}
    spot["spot"] = {"innerConeAngle": 0.3, "outerConeAngle": 0.5}
    glb.json["extensions"] = {"KHR_lights_punctual": {"lights": [spot]}}
    # lights and cameras look along -z
    light = {"KHR_lights_punctual": {"light": 0}}
    glb.add("nodes", {"extensions": light, "matrix": facing((-3.2, 2.3, -1.2), (-5.2, 4.2, -2.6))})
    lens = {"type": "perspective", "perspective": {"yfov": 0.5, "aspectRatio": 1.6, "znear": 0.1}}
    view = facing((0.2, 1.35, 6.6), (0.2, 2.15, 7.6))
    glb.add("nodes", {"camera": glb.add("cameras", lens), "matrix": view})
    glb.write(path)


def scene(path: Path, size: int = 640) -> wf.Scene:
    """Write the file and read it back: strict refuses whatever would be left out with a warning."""
    write(path)
    scene = wf.load(path, strict=True)
    assert scene.camera is not None
    scene.camera = scene.camera.resized((size, size * 5 // 8))  # a file gives the shape of a picture only
    scene.lights.append(wf.Environment((0.14, 0.17, 0.22)))  # and glTF has no light from all around
    return scene


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("output", nargs="?", default="gltf_scene.png")
    parser.add_argument("--spp", type=int, default=128)
    parser.add_argument("--size", type=int, default=640)
    options = parser.parse_args()
    path = Path(options.output).with_suffix(".glb")
    still_life = scene(path, options.size)
    shared = sum(isinstance(shape, wf.Instance) for shape in still_life.shapes)
    print(f"wrote {path} and read it: {still_life}; {shared} of the shapes share one mesh")
    wf.render(still_life, options.spp).save(options.output, tone="agx", exposure=0.5)
    print(f"wrote {options.output}")
