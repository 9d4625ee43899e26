"""Small glTF files, written by hand."""

import base64
import io
import json
import struct

import imageio.v3 as iio
import numpy as np

TRIANGLE = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.float32)
CODES = {"int8": 5120, "uint8": 5121, "int16": 5122, "uint16": 5123, "uint32": 5125, "float32": 5126}
TYPES = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4", 16: "MAT4"}


class Builder:
    """Writes the smallest glTF that says what a test needs."""

    def __init__(self):
        self.json = {
            "asset": {"version": "2.0"},
            "scene": 0,
            "scenes": [{"nodes": [0]}],
            "nodes": [{"mesh": 0}],
        }
        self.json |= {"accessors": [], "bufferViews": [], "meshes": []}
        self.binary = b""

    def view(self, data, **extra):
        self.json["bufferViews"].append(
            {"buffer": 0, "byteOffset": len(self.binary), "byteLength": len(data), **extra}
        )
        self.binary += data + bytes(-len(data) % 4)
        return len(self.json["bufferViews"]) - 1

    def accessor(self, values, **extra):
        values = np.asarray(values)
        values = values[:, None] if values.ndim == 1 else values
        item = {
            "componentType": CODES[values.dtype.name],
            "count": len(values),
            "type": TYPES[values.shape[1]],
        }
        self.json["accessors"].append({"bufferView": self.view(values.tobytes()), **item, **extra})
        return len(self.json["accessors"]) - 1

    def mesh(self, attributes=None, indices=None, **part):
        attributes = {"POSITION": TRIANGLE} if attributes is None else attributes
        part = {
            "attributes": {k: v if isinstance(v, int) else self.accessor(v) for k, v in attributes.items()}
        } | part
        if indices is not None:
            part["indices"] = self.accessor(indices)
        self.json["meshes"].append({"primitives": [part]})
        return self

    def image(self, codes):
        """Add a PNG as a texture and return its number."""
        data = io.BytesIO()
        iio.imwrite(data, codes, extension=".png")
        images = self.json.setdefault("images", [])
        images.append({"bufferView": self.view(data.getvalue()), "mimeType": "image/png"})
        textures = self.json.setdefault("textures", [])
        textures.append({"source": len(images) - 1})
        return {"index": len(textures) - 1}

    def material(self, **material):
        """Add a textured triangle with a material."""
        self.json["materials"] = [material]
        return self.mesh({"POSITION": TRIANGLE, "TEXCOORD_0": TRIANGLE[:, :2]}, material=0)

    def gltf(self, path):
        uri = "data:application/octet-stream;base64," + base64.b64encode(self.binary).decode()
        path.write_text(json.dumps(self.json | {"buffers": [{"byteLength": len(self.binary), "uri": uri}]}))
        return path

    def glb(self, path):
        text = json.dumps(self.json | {"buffers": [{"byteLength": len(self.binary)}]}).encode()
        text += b" " * (-len(text) % 4)
        body = struct.pack("<I4s", len(text), b"JSON") + text
        body += struct.pack("<I4s", len(self.binary), b"BIN\0") + self.binary
        path.write_bytes(b"glTF" + struct.pack("<II", 2, 12 + len(body)) + body)
        return path
