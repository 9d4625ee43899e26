"""CPU time of importing a scene, over that of reading its meshes alone.

Run: python benchmarks/import_speed.py [--scenes mitsuba-ply,...] [--repeat 7] [--profile]

Scenes of 200 meshes of 800 triangles, and of one mesh of 500 000, are written to a temporary folder. Each
is loaded by `wf.load`, in turn with its meshes alone by `wf.load_mesh`: file by file; of "gltf" the file
itself; of "usd" the same meshes as ply files. Of "usd-points" pxr reads the points, without a mesh. The table
has medians of the CPU times, and of their ratios, pair by pair.
"""

from __future__ import annotations

import argparse
import cProfile
import pstats
import statistics
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import wavefront as wf

SIZES = {"200 × 800": (200, 20), "1 × 500 000": (1, 500)}
Arrays = dict[str, np.ndarray]
Loads = tuple[Callable[[], Any], Callable[[], Any]]  # of the scene, and of its meshes


def terrain(n: int, seed: int) -> Arrays:
    """Return a mesh of 2·n² triangles with normals and texture coordinates, as float32 and int32."""
    rng = np.random.default_rng(seed)
    u, v = np.meshgrid(*[np.linspace(0, 1, n + 1)] * 2)
    z = 0.1 * np.sin(7 * u + rng.random()) * np.cos(5 * v)
    slope = 0.7 * np.cos(7 * u), -0.5 * np.sin(5 * v)
    normals = np.stack([-slope[0], -slope[1], np.ones_like(u)], -1).reshape(-1, 3)
    at = np.arange((n + 1) ** 2).reshape(n + 1, n + 1)
    a, b, c, d = (each.ravel() for each in (at[:-1, :-1], at[:-1, 1:], at[1:, 1:], at[1:, :-1]))
    points = np.stack([u + seed % 20, v + seed // 20, z], -1).reshape(-1, 3)
    faces = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    arrays = {"points": points, "normals": normals, "uvs": np.stack([u, v], -1).reshape(-1, 2)}
    return {name: each.astype(np.float32) for name, each in arrays.items()} | {
        "faces": faces.astype(np.int32)
    }


def write_ply(path: Path, mesh: Arrays) -> None:
    """Write a binary file."""
    names = ["x", "y", "z", "nx", "ny", "nz", "s", "t"]
    rows = np.hstack([mesh["points"], mesh["normals"], mesh["uvs"]])
    faces = np.empty(len(mesh["faces"]), [("count", "u1"), ("corners", "<i4", 3)])
    faces["count"], faces["corners"] = 3, mesh["faces"]
    header = ["ply", "format binary_little_endian 1.0", f"element vertex {len(rows)}"]
    header += [f"property float {name}" for name in names]
    header += [f"element face {len(faces)}", "property list uchar int vertex_indices", "end_header\n"]
    path.write_bytes("\n".join(header).encode() + rows.astype("<f4").tobytes() + faces.tobytes())


def write_obj(path: Path, mesh: Arrays) -> None:
    """Write a text file."""
    lines = [
        f"{key} " + " ".join(f"{x:.7g}" for x in row)
        for key, name in (("v", "points"), ("vt", "uvs"), ("vn", "normals"))
        for row in mesh[name].tolist()
    ]
    lines += ["f " + " ".join(f"{i}/{i}/{i}" for i in row) for row in (mesh["faces"] + 1).tolist()]
    path.write_text("\n".join(lines) + "\n")


def files_alone(files: list[Path]) -> Callable[[], Any]:
    """Return what reads all meshes."""
    return lambda: [wf.load_mesh(file, progress=False) for file in files]


def mitsuba(folder: Path, meshes: list[Arrays], kind: str) -> Loads:
    """Return the loads of a scene of Mitsuba, with a material and a matrix for each mesh."""
    files = [folder / f"{i}.{kind}" for i in range(len(meshes))]
    text = ['<scene version="3.0.0"><emitter type="constant"/>']
    for i, (file, mesh) in enumerate(zip(files, meshes, strict=True)):
        (write_ply if kind == "ply" else write_obj)(file, mesh)
        text.append(
            f'<shape type="{kind}"><string name="filename" value="{file.name}"/><transform name="to_world">'
            f'<translate z="{i}"/></transform><bsdf type="diffuse"><rgb name="reflectance" value="0.5"/>'
            "</bsdf></shape>"
        )
    scene = folder / "scene.xml"
    scene.write_text("\n".join([*text, "</scene>"]))
    return lambda: wf.load(scene, progress=False), files_alone(files)


def pbrt(folder: Path, meshes: list[Arrays]) -> Loads:
    """Return the loads of a scene of pbrt, with a material and a matrix for each mesh."""
    files = [folder / f"{i}.ply" for i in range(len(meshes))]
    text = ['Camera "perspective"', "WorldBegin", 'LightSource "infinite"']
    for i, (file, mesh) in enumerate(zip(files, meshes, strict=True)):
        write_ply(file, mesh)
        text.append(
            f'AttributeBegin Translate 0 0 {i} Material "diffuse" "rgb reflectance" [ .5 .5 .5 ] '
            f'Shape "plymesh" "string filename" "{file.name}" AttributeEnd'
        )
    scene = folder / "scene.pbrt"
    scene.write_text("\n".join(text))
    return lambda: wf.load(scene, progress=False), files_alone(files)


def gltf(folder: Path, meshes: list[Arrays]) -> Loads:
    """Return the loads of a binary glTF file."""
    import trimesh

    whole = trimesh.Scene()
    for i, mesh in enumerate(meshes):
        look = trimesh.visual.TextureVisuals(
            uv=mesh["uvs"], material=trimesh.visual.material.PBRMaterial(name=str(i))
        )
        part = trimesh.Trimesh(
            mesh["points"], mesh["faces"], vertex_normals=mesh["normals"], visual=look, process=False
        )
        whole.add_geometry(part, f"mesh{i}", transform=trimesh.transformations.translation_matrix((0, 0, i)))
    scene = folder / "scene.glb"
    scene.write_bytes(whole.export(file_type="glb"))
    paint = wf.Diffuse(0.5)
    return (
        lambda: wf.load(scene, progress=False),
        lambda: wf.load_mesh(scene, material=paint, progress=False),
    )


def usd(folder: Path, meshes: list[Arrays], points: bool) -> Loads:
    """Return the loads of a binary file of USD, beside ply files, or beside the points alone by pxr."""
    from pxr import Sdf, Usd, UsdGeom, Vt

    scene = str(folder / "scene.usdc")
    files = [folder / f"{i}.ply" for i in range(len(meshes))]
    stage = Usd.Stage.CreateNew(scene)
    UsdGeom.SetStageMetersPerUnit(stage, 1)
    for i, (file, mesh) in enumerate(zip(files, meshes, strict=True)):
        write_ply(file, mesh)
        prim = UsdGeom.Mesh.Define(stage, f"/mesh{i}")
        prim.AddTranslateOp().Set((0, 0, i))
        prim.CreateSubdivisionSchemeAttr("none")
        prim.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(mesh["points"]))
        prim.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(mesh["faces"].ravel()))
        prim.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(np.full(len(mesh["faces"]), 3, np.int32)))
        prim.CreateNormalsAttr(Vt.Vec3fArray.FromNumpy(mesh["normals"]))
        prim.SetNormalsInterpolation("vertex")
        uvs = UsdGeom.PrimvarsAPI(prim).CreatePrimvar("st", Sdf.ValueTypeNames.TexCoord2fArray, "vertex")
        uvs.Set(Vt.Vec2fArray.FromNumpy(mesh["uvs"]))
    stage.Save()
    del stage

    def read() -> Any:
        opened = Usd.Stage.Open(scene)
        return [np.array(UsdGeom.Mesh(prim).GetPointsAttr().Get()) for prim in opened.Traverse()]

    return lambda: wf.load(scene, progress=False), read if points else files_alone(files)


SCENES: dict[str, Callable[[Path, list[Arrays]], Loads]] = {
    "mitsuba-ply": lambda folder, meshes: mitsuba(folder, meshes, "ply"),
    "mitsuba-obj": lambda folder, meshes: mitsuba(folder, meshes, "obj"),
    "pbrt-ply": pbrt,
    "gltf": gltf,
    "usd": lambda folder, meshes: usd(folder, meshes, False),
    "usd-points": lambda folder, meshes: usd(folder, meshes, True),
}


def cpu(load: Callable[[], Any]) -> float:
    """Return the CPU time of a call, seconds."""
    begin = time.process_time()
    load()
    return time.process_time() - begin


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scenes", default=",".join(SCENES))
    parser.add_argument("--repeat", type=int, default=7)
    parser.add_argument("--profile", action="store_true", help="print where the time of each import goes")
    options = parser.parse_args()
    print(f"{'scene':>12} {'meshes':>12} {'scene, s':>9} {'meshes, s':>10} {'ratio':>6}", flush=True)
    for name in options.scenes.split(","):
        for size, (count, n) in SIZES.items():
            with tempfile.TemporaryDirectory() as folder:
                whole, alone = SCENES[name](Path(folder), [terrain(n, i) for i in range(count)])
                cpu(whole), cpu(alone)  # modules are imported, files are in the cache
                pairs = [(cpu(whole), cpu(alone)) for _ in range(options.repeat)]
                scene, meshes = (statistics.median(column) for column in zip(*pairs, strict=True))
                ratio = statistics.median(a / b for a, b in pairs)
                print(f"{name:>12} {size:>12} {scene:9.3f} {meshes:10.3f} {ratio:6.2f}", flush=True)
                if options.profile:
                    profile = cProfile.Profile()
                    profile.runcall(whole)
                    pstats.Stats(profile).sort_stats("tottime").print_stats(14)


if __name__ == "__main__":
    main()
