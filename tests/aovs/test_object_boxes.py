"""Boxes, masks and optical flow of objects, against their alone pictures and projections."""

import numpy as np
import pytest
import trimesh
from inside import installed
from trimesh.transformations import translation_matrix

import wavefront as wf

CAMERA = wf.Camera.look_at((0, 1, 6), (0, 0, 0), fov=40, size=(60, 40))
SKY = wf.Environment(1)
BOX = trimesh.creation.box((1, 1, 1))
CRATE = wf.Mesh(BOX.vertices, BOX.faces, name="crate")


def objects() -> list[wf.Shape]:
    """A ball before a crate before a wall, another crate half outside, one hidden, one behind the camera."""
    return [
        wf.Instance(CRATE, translation_matrix((0.5, 0, 0)), name="near crate"),
        wf.Sphere((0, 0, 1.5), 0.6, name="ball"),
        wf.Rectangle((-9, -9, -3), (18, 0, 0), (0, 18, 0), name="wall"),
        wf.Instance(CRATE, translation_matrix((3.2, 0, 0)), name="half crate"),
        wf.Instance(CRATE, np.diag([0.3, 0.3, 0.3, 1]) @ translation_matrix((0, 0, 2)), name="hidden crate"),
        wf.Sphere((0, 1, 9), 1, name="behind"),
    ]


def extent(mask: np.ndarray) -> list[int] | None:
    """Return the box of a mask (h, w)."""
    rows, columns = np.nonzero(mask)
    if not rows.size:
        return None
    return [int(columns.min()), int(rows.min()), int(columns.max()) + 1, int(rows.max()) + 1]


@pytest.mark.parametrize(
    "accel", ["numpy", pytest.param("embree", marks=pytest.mark.skipif(not installed(), reason="no embreex"))]
)
def test_boxes_are_those_of_the_objects_seen_and_of_each_alone(accel) -> None:
    """Embree copies such small instances to meshes of their own."""
    shapes = objects()
    image = wf.render(wf.Scene(shapes, [SKY], CAMERA), spp=1, aovs=("boxes", "shape_id"), accel=accel)
    found = {box["shape"]: box for box in image.boxes}
    assert [found[number]["name"] for number in sorted(found)] == [shape.name for shape in shapes[:5]]
    for number, shape in enumerate(shapes[:5]):
        alone = wf.render(wf.Scene([shape], [SKY], CAMERA), spp=1, aovs="shape_id").shape_id >= 0
        seen = image.shape_id == number
        assert found[number]["visible"] == extent(seen)
        assert found[number]["amodal"] == extent(alone)
        assert found[number]["visible_fraction"] == pytest.approx(seen.sum() / alone.sum(), abs=2e-3)
    assert found[4]["visible"] is None
    assert found[4]["visible_fraction"] == 0
    assert found[1]["visible_fraction"] == 1
    assert 0 < found[0]["visible_fraction"] < 1
    assert found[3]["amodal"][2] == 60  # boxes end with the picture


def test_boxes_go_through_what_is_clear_and_survive_saving(tmp_path) -> None:
    veil = wf.Material(wf.Diffuse(0.5), alpha=0.2)
    shapes = [wf.Sphere((0, 0, 0), 1), wf.Rectangle((-9, -9, 2), (18, 0, 0), (0, 18, 0), material=veil)]
    image = wf.render(wf.Scene(shapes, [SKY], CAMERA), spp=1, aovs="boxes")
    assert [box["shape"] for box in image.boxes] == [0]
    image.save(tmp_path / "a.npz")
    assert wf.Image.load(tmp_path / "a.npz").boxes == image.boxes


def test_an_empty_view_has_no_boxes() -> None:
    away = wf.Camera.look_at((0, 0, 6), (0, 0, 9), size=(8, 8))
    image = wf.render(wf.Scene([wf.Sphere((0, 0, 0), 1)], [SKY], away), spp=1, aovs=("boxes", "depth"))
    assert image.boxes == []
    assert np.isnan(image.depth).all()
    plain = wf.render(wf.Scene([wf.Sphere((0, 0, 0), 1)], [SKY], away), spp=1)
    with pytest.raises(AttributeError, match="boxes"):
        _ = plain.boxes


def test_masks_by_name_and_by_id() -> None:
    shapes = [*objects(), wf.Sphere((-1.5, 0, 0), 0.5, name="ball")]
    names = ("shape_id", "instance_id", "material_id")
    image = wf.render(wf.Scene(shapes, [SKY], CAMERA), spp=1, aovs=names)
    assert (image.mask("ball") == np.isin(image.shape_id, (1, 6))).all()
    assert (image.mask(0) == (image.shape_id == 0)).all()
    assert (image.mask("half crate", "instance") == (image.shape_id == 3)).all()
    assert not image.mask("hidden crate").any()
    with pytest.raises(wf.SceneError, match="no shape 'bull'"):
        image.mask("bull")
    with pytest.raises(wf.SceneError, match="kind"):
        image.mask("ball", "thing")
    with pytest.raises(wf.SceneError, match="shape_id"):
        wf.render(wf.Scene(shapes, [SKY], CAMERA), spp=1).mask("ball")


@pytest.mark.parametrize("crop", [None, (7, 5, 40, 33)])
def test_motion_leads_to_what_the_other_camera_sees(crop) -> None:
    other = wf.Camera.look_at((0.5, 1.2, 5.5), (0, 0, 0), fov=42, size=(60, 40), crop=crop)
    shapes = [wf.Sphere((0, 0, 0), 1), wf.Rectangle((-1.5, -1, -4), (0, 0, 6), (4, 0, 0))]
    scene = wf.Scene(shapes, [SKY])
    here, there = (wf.render(scene, spp=1, camera=each, aovs="position") for each in (CAMERA, other))
    flow = here.motion(other)
    assert (np.isnan(flow) == np.isnan(here.position[..., :2])).all()
    y, x = np.mgrid[:40, :60] + 0.5
    column, row = np.floor(x + flow[..., 0]), np.floor(y + flow[..., 1])
    height, width = there.position.shape[:2]
    inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
    seen = there.position[row[inside].astype(int), column[inside].astype(int)]
    gap = np.linalg.norm(seen - here.position[inside], axis=1)
    assert inside.sum() > 300
    assert np.nanmedian(gap) < 0.1  # a pixel is about so large
    assert np.isnan(gap).mean() < 0.05  # at outlines
    assert np.abs(here.motion(CAMERA)[np.isfinite(flow)]).max() < 0.01
    with pytest.raises(wf.SceneError, match="position"):
        wf.render(scene, spp=1, camera=CAMERA).motion(other)
