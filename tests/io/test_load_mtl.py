"""MTL maps, their options, and the PBR extension."""

import inspect
from types import SimpleNamespace

import imageio.v3 as iio
import numpy as np
import pytest
import trimesh
from inside import (
    BumpMap,
    Dielectric,
    Diffuse,
    NormalMap,
    Principled,
    SceneError,
    Texture,
    from_trimesh,
    load_meshes,
    write_image,
)
from PIL import Image as Pil

CODES = np.random.default_rng(0).integers(0, 256, (4, 8, 3), np.uint8)
POINTS = np.random.default_rng(1).random((2, 40), np.float32)


@pytest.fixture
def one(tmp_path):
    """Load a textured triangle whose material has the given lines, beside an image `t.png`."""
    iio.imwrite(tmp_path / "t.png", CODES)
    (tmp_path / "t.psd").write_bytes(bytes(100))
    (tmp_path / "broken.png").write_bytes((tmp_path / "t.png").read_bytes()[:60])

    def load_one(*lines, **arguments):
        (tmp_path / "s.mtl").write_text("\n".join(["newmtl m", *lines]))
        text = "mtllib s.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nusemtl m\nf 1/1 2/2 3/3\n"
        (tmp_path / "a.obj").write_text(text)
        (mesh,) = load_meshes(tmp_path / "a.obj", **arguments)
        return mesh

    return load_one


@pytest.fixture
def given(one, principled_recorded):
    """Load a material as the parameters that `Principled` would be given."""
    return lambda *lines: one(*lines).material.bsdf.given


def same(texture, **arguments):
    """Tell whether a texture is the image with these arguments."""
    return np.array_equal(texture.lookup(POINTS), Texture(CODES, **arguments).lookup(POINTS))


def test_map_kd_is_multiplied_by_kd(one):
    assert same(one("Kd 1 0.5 0", "map_Kd t.png").material.bsdf.reflectance, scale=[1, 0.5, 0])
    assert same(one("map_Kd t.png").material.bsdf.reflectance)
    assert same(one("Kd 0 0 0", "map_Kd t.png").material.bsdf.reflectance)


@pytest.mark.parametrize("name", ["a b.png", "1 2 3.png", "sub\\c.png", "sub/c.png", "ü#1.png"])
def test_names_of_images(one, tmp_path, name):
    (tmp_path / "sub").mkdir()
    iio.imwrite(tmp_path / name.replace("\\", "/"), CODES)
    assert same(one(f"map_Kd {name}").material.bsdf.reflectance)
    assert same(one(f"map_Kd -s 1 1 1 {name}").material.bsdf.reflectance)


def test_options_place_the_image(one):
    found = one("map_Kd -s 2 3 1 -o 0.25 0.5 t.png").material.bsdf.reflectance
    assert same(found, transform=[[2, 0, 0.25], [0, 3, 0.5], [0, 0, 1]])
    assert same(one("map_Kd -s 2 t.png").material.bsdf.reflectance, transform=np.diag([2.0, 1, 1]))
    clamped = one("map_Kd -clamp on -o 0.7 t.png").material.bsdf.reflectance
    assert same(clamped, wrap="clamp", transform=[[1, 0, 0.7], [0, 1, 0], [0, 0, 1]])
    assert same(
        one("Kd 0.5 0.5 0.5", "map_Kd -mm 0.25 0.5 t.png").material.bsdf.reflectance, scale=0.25, offset=0.125
    )


def test_options_without_effect_are_named(one):
    with pytest.warns(UserWarning, match=r"not honored: s\.mtl, material 'm': -blendu of map_Kd"):
        assert same(one("map_Kd -blendu off -texres 512 t.png").material.bsdf.reflectance)
    with pytest.warns(UserWarning, match="not honored: .*: -imfchan of map_Kd"):
        assert same(one("map_Kd -imfchan r t.png").material.bsdf.reflectance)


def noted(one, lines, message):
    """Load a material of which one thing is noted, and with `strict` refused."""
    with pytest.warns(UserWarning, match=message) as record:
        mesh = one(*lines)
    assert len(record) == 1
    with pytest.raises(SceneError, match=message):
        one(*lines, strict=True)
    return mesh.material


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("map_Kd -foo 1 t.png", r"not honored: s\.mtl, material 'm': -foo of map_Kd$"),
        ("map_Kd -mm a b t.png", r"s\.mtl line \d: map_Kd is with -mm a b; without that option$"),
        ("map_Kd -s nan 1 t.png", r"s\.mtl line \d: map_Kd is with -s nan 1; without that option$"),
    ],
)
def test_damaged_options_cost_no_more_than_themselves(one, line, message):
    assert same(noted(one, [line], message).bsdf.reflectance)


def test_a_channel_that_does_not_exist(one):
    found = noted(one, ["Pm 1", "map_Pr -imfchan q t.png"], "map_Pr is with -imfchan q; without that option$")
    assert same(found.bsdf.roughness, srgb=False, channel="luminance")


@pytest.mark.parametrize("line", ["map_Kd", "map_Kd ", "map_Kd -s 2", "map_bump", "map_d", "norm ", "map_Pr"])
def test_blank_maps_are_left_out(one, line):
    found = noted(
        one, ["Kd 0.3 0.3 0.3", line], rf"s\.mtl line 3: {line.split()[0]} is without a file; left out$"
    )
    assert found.bsdf.reflectance.ravel() == pytest.approx([0.3] * 3)
    assert (found.normal_map, found.opacity) == (None, None)


def test_blank_maps_that_are_not_read_are_named(one):
    noted(one, ["Kd 0.3 0.3 0.3", "refl "], "not honored: .*: refl$")


GRAY = [0.3] * 3


@pytest.mark.parametrize(
    ("lines", "message", "reflectance"),
    [
        (["Kd red"], r"s\.mtl line 2: Kd is 'red'; left out$", [0.5] * 3),
        (["Kd nan 0 0"], "Kd is 'nan 0 0'; left out$", [0.5] * 3),
        (["Kd 1e400 0 0"], "left out$", [0.5] * 3),
        (["Kd 1,0 0,5 0,5"], "Kd is '1,0 0,5 0,5'; left out$", [0.5] * 3),
        (["Kd 0 0"], "Kd is '0 0'; left out$", [0.5] * 3),
        (["Kd"], "Kd is ''; left out$", [0.5] * 3),
        (["Kd spectral a.rfl"], "Kd is 'spectral a.rfl'; left out$", [0.5] * 3),
        (["Kd .3 .3 .3 1"], r"Kd is '\.3 \.3 \.3 1'; the first three in its place$", GRAY),
        (["Kd .3 .3 .3", "Ns nan"], "Ns is 'nan'; left out$", GRAY),
        (["Kd .3 .3 .3", "Ks 1 1", "Ns 9"], "Ks is '1 1'; left out$", GRAY),
        (["Kd .3 .3 .3", "Ke a"], "Ke is 'a'; left out$", GRAY),
        (["Kd .3 .3 .3", "illum"], "illum is ''; left out$", GRAY),
        (["Kd .3 .3 .3", "illum nan"], "illum is 'nan'; left out$", GRAY),
        (
            ["Kd .3 .3 .3", "Ni 0", "d 0.5"],
            "Ni is '0'; left out, as an index must be above 0, from 1e-06",
            GRAY,
        ),
        (["Kd .3 .3 .3", "d 1.5"], r"d is '1\.5'; clamped, as it must be in \[0, 1\]$", GRAY),
        (["Kd .3 .3 .3", "Tr -2"], r"Tr is '-2'; clamped", GRAY),
        (
            ["Kd .3 .3 .3", "d -halo .6"],
            "d is '-halo .6'; the same opacity from all sides in its place$",
            GRAY,
        ),
        (["Kd .3 .3 .3", "d -halo"], "d is '-halo'; left out$", GRAY),
    ],
)
def test_damaged_lines_cost_no_more_than_themselves(one, lines, message, reflectance):
    found = noted(one, lines, message)
    assert isinstance(found.bsdf, Diffuse)
    assert found.bsdf.reflectance.ravel() == pytest.approx(reflectance)
    opacity = {"d 0.5": 0.5, "d -halo .6": 0.6}.get(lines[-1])
    assert (None if found.opacity is None else found.opacity.constant) == pytest.approx(opacity)


def test_an_index_that_is_none(one):
    assert noted(one, ["illum 4", "Ni -1"], "Ni is '-1'; left out").bsdf.ior == pytest.approx(1.5)
    assert noted(one, ["illum 4", "Ni 1e30"], "Ni is '1e30'; left out").bsdf.ior == pytest.approx(1.5)


def test_colors_in_xyz(one):
    """D65 white of half the brightness is gray."""
    found = one("Kd xyz 0.4752 0.5 0.5445", strict=True).material.bsdf.reflectance.ravel()
    assert found == pytest.approx([0.5] * 3, abs=1e-3)
    red = noted(one, ["Kd xyz 0.4124 0.2126 0.0193"], "Kd is .*; clamped").bsdf.reflectance.ravel()
    assert red == pytest.approx([1, 0, 0], abs=1e-3)


def test_a_line_before_newmtl_is_left_out(one, tmp_path):
    (tmp_path / "t.mtl").write_text("Kd 1 0 0\nnewmtl m\nKd .3 .3 .3\n")
    (tmp_path / "b.obj").write_text("mtllib t.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl m\nf 1 2 3\n")
    with pytest.warns(UserWarning, match=r"t\.mtl line 1: Kd is before the first newmtl; left out$"):
        (mesh,) = load_meshes(tmp_path / "b.obj")
    assert mesh.material.bsdf.reflectance.ravel() == pytest.approx(GRAY)


@pytest.mark.parametrize(
    ("line", "names"),
    [
        ("a.mtl b.mtl", ["a.mtl", "b.mtl"]),
        ("a.mtl \t b c.MTL", ["a.mtl", "b c.MTL"]),
        ('"a b.mtl"', ["a b.mtl"]),
        ("a b.mtl c.mtl", ["a b.mtl c.mtl"]),
        ("a.mtl gone.mtl", ["a.mtl"]),
    ],
)
def test_several_material_files_on_one_line(tmp_path, line, names):
    faces = ""
    for number, name in enumerate(names):
        (tmp_path / name).write_text(f"newmtl m{number}\nKd .3 .3 .3\n")
        faces += f"usemtl m{number}\nf 1 2 3\n"
    (tmp_path / "a.obj").write_text(f"mtllib {line}\nv 0 0 0\nv 1 0 0\nv 0 1 0\n{faces}")
    if "gone" in line:
        with pytest.warns(UserWarning, match=r"material file 'gone\.mtl' is missing"):
            meshes = load_meshes(tmp_path / "a.obj")
    else:
        meshes = load_meshes(tmp_path / "a.obj", strict=True)
    assert len(meshes) == len(names)
    for mesh in meshes:
        assert mesh.material.bsdf.reflectance.ravel() == pytest.approx(GRAY)


OPAQUE = ["Kd 0.8 0.1 0.1", "Kd 0.8 0.1 0.1\nd 1.0", "Kd 1 1 1\nmap_Kd t.png\nd 1.0", "map_Kd t.png", "d 1"]
OPAQUE += ["Kd 0.8 0.1 0.1\nNi 1.0", "Kd 0.8 0.1 0.1\nKs 1 1 1\nNs 50", "Kd 0 0 0\nmap_Kd t.png"]
CLEAR = ["", "Kd 0.8 0.1 0.1\nNi 1.33", "Kd 0.8 0.1 0.1\nTf 1 0.9 0.9", "Kd 0.8 0.1 0.1\nd 0.2\nNi 1.5"]
CLEAR += ["Kd 0 0 0", "Kd 0.8 0.1 0.1\nd 0.5"]


@pytest.mark.parametrize("illum", [4, 6, 7, 9])
@pytest.mark.parametrize("lines", [*OPAQUE, *CLEAR])
def test_illum_of_glass_on_what_is_opaque(one, illum, lines):
    """Some programs, such as Cinema 4D, write it for all materials."""
    bsdf = one(*lines.split("\n"), f"illum {illum}", strict=True).material.bsdf
    assert isinstance(bsdf, Dielectric) == (lines in CLEAR)


@pytest.mark.parametrize(
    ("lines", "missing", "plain"),
    [
        (("Kd 0.2 0.4 0.6", "map_Kd no.png"), "line 3: map_Kd: texture 'no.png'", ("Kd 0.1 0.2 0.3",)),
        (("map_Kd -s 2 2 sub/no.png",), "line 2: map_Kd: texture 'sub/no.png'", ("Kd 0.5 0.5 0.5",)),
        (("map_Ke no.exr",), "line 2: map_Ke: texture 'no.exr'", ()),
        (("Ke 1 1 1", "map_Ke no.exr"), "line 3: map_Ke: texture 'no.exr'", ()),
        (("map_d no.png",), "line 2: map_d: texture 'no.png'", ()),
        (("map_Pr no.png",), "line 2: map_Pr: texture 'no.png'", ()),
        (("norm no.png",), "line 2: norm: texture 'no.png'", ()),
        (("map_Bump -bm 2 no.tga",), "line 2: map_Bump: texture 'no.tga'", ()),
        (("map_Kd " + "n" * 3000,), "line 2: map_Kd: texture 'nnn", ("Kd 0.5 0.5 0.5",)),
    ],
)
def test_missing_images_are_announced_and_left_out(one, lines, missing, plain):
    """But for colors, which are gray."""
    done = "gray in its place" if "map_Kd" in missing else "left out"
    with pytest.warns(UserWarning, match=rf"s\.mtl {missing}.*; {done}$") as record:
        mesh = one(*lines)
    assert len(record) == 1
    expected = one(*plain)
    assert type(mesh.material.bsdf) is type(expected.material.bsdf) is Diffuse
    found = mesh.material.bsdf.reflectance
    color = found.mean() if isinstance(found, Texture) else found.ravel()
    assert color == pytest.approx(expected.material.bsdf.reflectance.ravel())
    assert mesh.emission is None
    with pytest.raises(SceneError, match=rf"s\.mtl {missing}.*; {done}$"):
        one(*lines, strict=True)


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("map_Kd t.psd", r"texture 't\.psd': t\.psd: extension is '\.psd'; it must be one of"),
        ("map_Kd broken.png", r"texture 'broken\.png': broken\.png: ends early: .*; gray in its place"),
        ("norm broken.png", r"texture 'broken\.png': broken\.png: ends early: .*; left out"),
        (
            "map_d nan.exr",
            r"texture 'nan\.exr': .* has 1 value that is not finite.*; left out",
        ),
        (
            "map_Kd ../no.png",
            r"texture '\.\./no\.png': s\.mtl: refers to .*outside.*; gray in its place",
        ),
        ("map_Kd C:\\no.png", r".*an absolute path is not followed; gray in its place"),
    ],
)
def test_damaged_images_cost_no_more_than_themselves(one, tmp_path, line, message):
    write_image(tmp_path / "nan.exr", np.array([[[1, np.nan, 1]]], np.float32))
    with pytest.warns(UserWarning, match=rf"s\.mtl line 3: \w+: {message}"):
        mesh = one("Ka 0 0 0", line)
    color = mesh.material.bsdf.reflectance
    assert (color.mean() if isinstance(color, Texture) else color.ravel()) == pytest.approx([0.5] * 3)
    assert mesh.material.normal_map is None


@pytest.mark.parametrize("options", ["", "-imfchan l "])
@pytest.mark.parametrize("shape", [(1, 2, 2), (1, 2, 4), (1, 2, 3)])
def test_opacity_is_the_alpha_of_an_image(one, tmp_path, shape, options):
    """Without alpha, or where the file says so, it is the luminance."""
    codes = np.zeros(shape, np.uint8)
    codes[0, 0] = 255
    codes[0, 0, 0] = 0 if shape[2] % 2 == 0 else 255
    Pil.fromarray(codes).save(tmp_path / "leaf.png")
    alpha = one(f"map_d {options}leaf.png").material.alpha
    has_alpha = shape[2] in (2, 4)
    luminance = 1 - 0.2126 if shape[2] == 4 else 0 if shape[2] == 2 else 1
    assert alpha.mean() * 2 == pytest.approx(1 if has_alpha and not options else luminance, abs=2e-3)


def test_the_pbr_extension(given):
    words = "Pr 0.3", "Pm 0.9", "Ps 0.1", "Pc 0.5", "Pcr 0.25"
    found = given("Kd 0.2 0.4 0.6", *words)
    assert found.pop("base_color").tolist() == [0.2, 0.4, 0.6]
    due = {"roughness": 0.3, "metallic": 0.9, "sheen": 0.1, "clearcoat": 0.5, "clearcoat_roughness": 0.25}
    plain = {name: p.default for name, p in inspect.signature(Principled).parameters.items()}
    assert found == {name: due.get(name, plain[name]) for name in found}
    with pytest.warns(UserWarning, match="not honored: .*: anisotropy"):
        given(*words, "aniso 0.75")
    for number in (0, 1):
        assert given("Pr 0.5", f"Pm {number}", f"Ps {number}")["sheen"] == number
        assert given("Pr 0.5", f"Pm {number}", f"Ps {number}")["metallic"] == number


def test_pbr_maps(given):
    found = given("map_Pr t.png", "Pm 0.5", "map_Pm -imfchan b t.png")
    assert same(found["roughness"], srgb=False, channel="luminance")
    assert same(found["metallic"], srgb=False, channel=2, scale=0.5)


@pytest.mark.parametrize(
    "lines", [["Kd 1 0 0"], ["Pr 0.3", "Pm 1"], ["illum 7", "Ni 1.5"], ["illum 3", "Ks 1 1 1"]]
)
def test_norm_is_a_normal_map_of_any_material(one, lines):
    normal_map = one(*lines, "norm -bm 0.5 -s 2 2 t.png").material.normal_map
    assert isinstance(normal_map, NormalMap)
    assert normal_map.strength == 0.5
    assert same(normal_map.texture, srgb=False, transform=np.diag([2.0, 2, 1]))
    assert one(*lines).material.normal_map is None


@pytest.mark.parametrize("keyword", ["bump", "map_bump", "map_Bump"])
def test_bump_is_a_map_of_heights(one, keyword):
    normal_map = one(f"{keyword} -bm 0.2 -mm 0.1 2 t.png").material.normal_map
    assert isinstance(normal_map, BumpMap)
    assert normal_map.height == np.float32(0.2)
    assert same(normal_map.texture, srgb=False, channel="luminance", scale=2, offset=0.1)
    chosen = one(f"{keyword} -imfchan g t.png").material.normal_map
    assert chosen.height == 1
    assert same(chosen.texture, srgb=False, channel=1)


def test_a_bump_map_that_looks_like_normals_is_one(one, tmp_path):
    codes = np.random.default_rng(1).normal([128, 128, 240], 8, (16, 16, 3)).clip(0, 255).astype(np.uint8)
    iio.imwrite(tmp_path / "n.png", codes)
    normal_map = one("map_Bump -bm 0.7 n.png").material.normal_map
    assert isinstance(normal_map, NormalMap)
    assert normal_map.strength == np.float32(0.7)
    assert isinstance(one("map_Bump -imfchan b n.png").material.normal_map, BumpMap)
    iio.imwrite(tmp_path / "n.png", codes[..., 2])
    assert isinstance(one("map_Bump n.png").material.normal_map, BumpMap)


@pytest.mark.parametrize(
    ("line", "message", "kind"),
    [
        ("bump -bm x t.png", "bump is with -bm x; without that option$", BumpMap),
        ("bump -bm nan t.png", "bump is with -bm nan; without that option$", BumpMap),
        (
            "norm -s 0 t.png",
            r"s\.mtl line 2: norm: NormalMap: the transform of .* singular; .*; left out$",
            None,
        ),
    ],
)
def test_defects_of_normal_maps(one, line, message, kind):
    found = noted(one, [line], message).normal_map
    assert found is None if kind is None else isinstance(found, kind)


@pytest.mark.filterwarnings(r"ignore:.*s\.mtl. not honored")
@pytest.mark.parametrize(
    "line", ["map_Pr t.png", "map_Ke t.png", "map_d t.png", "norm t.png", "map_Bump t.png"]
)
def test_images_that_trimesh_leaves_out_are_named(one, tmp_path, monkeypatch, line):
    one("Kd 1 0.5 0", "map_Kd t.png", line)
    monkeypatch.chdir(tmp_path)  # where t.png is: it is not looked for
    held = trimesh.load(tmp_path / "a.obj", process=False)
    with pytest.warns(UserWarning, match=f"not honored: .*: {line.split()[0].lower()}"):
        (mesh,) = from_trimesh(held).shapes
    assert isinstance(mesh.material.bsdf, Diffuse)
    assert mesh.emission is None


@pytest.mark.parametrize("illum", [(), ("illum 2",)])
@pytest.mark.parametrize(("ns", "roughness"), [(1e-3, 0.999), (10, 0.9), (250, 0.5), (1000, 0), (1e5, 0)])
def test_ks_and_ns_are_a_gloss(one, illum, ns, roughness):
    """The reflectance along the normal is 0.08 · Ks, the roughness 1 − √(Ns/1000), as in Blender."""
    found = one("Kd 0.25 0.5 1", "Ks 1 0.5 0.25", f"Ns {ns}", *illum).material.bsdf
    assert isinstance(found, Principled)
    assert found.base_color.ravel().tolist() == [0.25, 0.5, 1]
    assert found.roughness == pytest.approx([roughness])
    assert found.layers().base.gloss.schlick(np.zeros(1, np.float32)).ravel() == pytest.approx(
        [0.08, 0.04, 0.02], rel=1e-6
    )
    assert found.specular_weight == 1


def test_the_gloss_that_blender_writes_is_that_of_principled(one):
    found = one("Kd 0.5 0.5 0.5", "Ks 0.5 0.5 0.5", "Ns 250", "Ni 1.45").material.bsdf
    plain = Principled(0.5)
    assert vars(found).keys() == vars(plain).keys()
    for name, value in vars(plain).items():
        assert value is None or getattr(found, name) == pytest.approx(value), name


def test_a_faint_gloss_is_faint_at_grazing_angles_too(one):
    faint = one("Ks 0.05 0.05 0.05", "Ns 250").material.bsdf
    gloss = faint.layers().base.gloss
    assert gloss.schlick(np.zeros(1, np.float32)) == pytest.approx(np.full((3, 1), 0.004), rel=1e-5)
    assert gloss.schlick(np.ones(1, np.float32)) == pytest.approx(np.full((3, 1), 0.2))


@pytest.mark.parametrize(
    "lines",
    [
        ["Ks 1 1 1", "Ns 200", "illum 1"],
        ["Ks 1 1 1", "Ns 0", "map_Ks t.png", "illum 2"],
        ["Ks 0 0 0", "Ns 200"],
        ["Ns 200", "illum 2"],
    ],
)
def test_without_a_highlight_a_surface_is_matte(one, lines):
    assert isinstance(one("Kd 0.5 0.5 0.5", *lines).material.bsdf, Diffuse)


@pytest.mark.parametrize(
    ("lines", "expected"),
    [
        (["Pr 0 # mirror"], {"roughness": 0}),
        (["Ps 0.5"], {"roughness": 1, "specular": 0}),
        (["Ks 0.5 0.5 0.5"], {"roughness": 1}),
        (["Ks 1 1 1", "Ns 250", "Pm 0.7"], {"roughness": 0.5}),
        (["Ns 250", "Pm 0.7"], {"roughness": 0.5}),
        (["Ks 0 0 0", "Pr 0.3", "illum 1"], {"roughness": 0.3, "ior": 1.5, "specular": 1}),
    ],
)
def test_roughness_and_gloss(given, lines, expected):
    found = given("# a comment", *lines)
    assert {name: found[name] for name in expected} == expected


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        (["Ks 1 1 1", "Ns -3"], r"s\.mtl line 3: Ns is -3; clamped, as it must be at least 0"),
        (["Pr 1.5"], r"s\.mtl line 2: Pr is 1\.5; clamped, as it must be in \[0, 1\]"),
    ],
)
def test_numbers_outside_their_range_are_clamped(given, lines, message):
    with pytest.warns(UserWarning, match=message):
        assert given(*lines)["roughness"] == 1


def test_the_pbr_extension_goes_before_ks_and_ns(given):
    both = given("Ks 1 1 1", "Ns 250", "Pr 0.3")
    assert both["roughness"] == 0.3
    assert ((both["ior"] - 1) / (both["ior"] + 1)) ** 2 == pytest.approx(0.08)


def test_map_ks_is_the_strength_of_the_gloss(given):
    """Below a reflectance of 0.02 the strength is less than 1 everywhere."""
    assert same(given("map_Ks t.png")["specular"])
    found = given("Ks 0.125 0.0625 0.125", "map_Ks -s 2 2 t.png")
    assert same(found["specular"], scale=0.5, transform=np.diag([2.0, 2, 1]))
    assert found["specular_color"].tolist() == [1, 0.5, 1]


def test_a_map_of_the_gloss_counts_by_its_luminance(one):
    strength = one("Ks 1 1 1", "map_Ks t.png").material.bsdf.specular_weight
    assert strength.scalar
    seen = Texture(CODES).lookup(POINTS)
    surface = SimpleNamespace(uv=POINTS)
    assert strength.at(surface) == pytest.approx(0.2126 * seen[0] + 0.7152 * seen[1] + 0.0722 * seen[2])


def test_alpha(one):
    assert one("d 0.25").material.opacity.constant == 0.25
    assert one("Tr 0.25").material.opacity.constant == 0.75
    assert one("d 0.5", "Pr 0.3").material.opacity.constant == 0.5
    assert one("d 0.5", "Ks 1 1 1", "illum 3").material.opacity.constant == 0.5
    assert one("Kd 1 1 1").material.opacity is None
    found = one("d 0.5", "Ni 1.5", "map_d t.png").material  # a cut-out, not glass
    assert isinstance(found.bsdf, Diffuse)
    assert same(found.opacity.alpha, srgb=False, channel="luminance", scale=0.5)
    assert found.opacity.cutoff is None


def test_map_ke(one):
    assert same(one("Ke 4 2 1", "map_Ke t.png").emission, scale=[4, 2, 1])
    assert same(one("map_Ke t.png").emission)
    assert one("Ke 4 2 1").emission.ravel().tolist() == [4, 2, 1]


@pytest.mark.parametrize(
    ("lines", "named"),
    [
        (["Ka 0.2 0.2 0.2"], "Ka"),
        (["Ks 0.5 0.5 0.5", "Ni 1.5", "illum 4"], "Ks"),
        (["norm t.png", "map_Bump t.png"], "map_Bump"),
        (["disp t.png"], "disp"),
        (["refl -type sphere t.png"], "refl"),
        (["Tf 0.5 0.5 0.5"], "Tf"),
        (["Ks 0.5 0.5 0.5", "map_Ns t.png"], "map_Ns"),
        (["illum 10"], "illum"),
        (["anisor 0.5"], "anisor"),
    ],
)
def test_what_is_not_honored_is_named(one, lines, named):
    with pytest.warns(UserWarning, match=rf"a\.obj: not honored: s\.mtl, material 'm': {named}$") as record:
        one("Kd 0.5 0.5 0.5", *lines)
    assert len(record) == 1
    with pytest.raises(SceneError, match="not honored"):
        one("Kd 0.5 0.5 0.5", *lines, strict=True)


def test_values_that_change_nothing_are_quiet(one):
    one("Ka 0 0 0", "Kd 0.5 0.5 0.5", "Ks 0.000000 0.000000 0.000000", "Ns 96", "Ni 1.45", "d 1.0", "illum 2")
    one("Kd 0.5 0.5 0.5", "Tf 1 1 1", "Tr 0", "illum 1", "sharpness 60")
    one("Kd 0.5 0.5 0.5", "Ks 1 1 1", "Ns 200", "map_Ks t.png", "illum 0")


def test_glass_keeps_a_kd_quiet(one):
    mesh = one("Kd 0.8 0.8 0.8", "Ni 1.5", "d 0.1", "illum 4")
    assert isinstance(mesh.material.bsdf, Dielectric)
    assert one("Pr 0.3", "illum 4").material.bsdf.roughness == pytest.approx([0.3])
