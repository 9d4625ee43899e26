"""Denoisers: they lower the error, keep the mean and edges, and survive odd pictures."""

import sys
from pathlib import Path

import numpy as np
import pytest
from inside import main, noisy_picture, without_holes
from inside import open_image_denoise as module
from significance import render

import wavefront as wf

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "examples"))
import gltf_scene
import material_sheet
from cornell_box import cornell_box

DENOISERS = ("oidn", "nonlocal_means")


def scene_like(size=(48, 64), spp=16, seed=0):
    """A noisy picture of a textured wall and floor with guides, and the exact picture."""
    rng, (height, width) = np.random.default_rng(seed), size
    y, x = np.mgrid[:height, :width] / max(size)
    floor = (y > 0.45)[..., None]
    checks = ((x * 16).astype(int) + (y * 16).astype(int)) % 2
    albedo = np.where(floor, np.where(checks[..., None], (0.8, 0.7, 0.6), 0.2), (0.3, 0.5, 0.8))
    normal = np.where(floor, (0.0, 1, 0), (0.0, 0, 1))
    exact = albedo * (0.2 + np.exp(-8 * ((x - 0.4) ** 2 + (y - 0.4) ** 2)))[..., None]
    samples = exact[..., None] * rng.gamma(0.5, 2, (height, width, 1, spp))
    standard_error = samples.std(-1, ddof=1) / spp**0.5
    guides = {"denoising_albedo": albedo, "denoising_normal": normal}
    noisy = {name: values + rng.normal(0, 0.03, values.shape) for name, values in guides.items()}
    image = wf.Image(
        samples.mean(-1).astype(np.float32),
        spp,
        {"seed": seed, "noise": 0.2},
        standard_error=standard_error.astype(np.float32),
        layers={name: values.astype(np.float32) for name, values in noisy.items()},
        errors={name: np.full_like(values, 0.03, np.float32) for name, values in noisy.items()},
    )
    return image, exact


def relative_mse(image, exact):
    return wf.compare(image, exact).relative_mse


@pytest.fixture(params=DENOISERS)
def denoiser(request):
    if request.param == "oidn":
        pytest.importorskip("pyoidn")
    return request.param


def test_error_and_mean(denoiser) -> None:
    image, exact = scene_like()
    found = image.denoise(denoiser)
    assert relative_mse(found, exact) < 0.25 * relative_mse(image, exact)
    assert found.rgb.mean() == pytest.approx(image.rgb.mean(), rel=0.01)
    assert found.rgb.dtype == np.float32
    assert found.metadata["denoiser"] == denoiser
    assert image.denoise().metadata["denoiser"] == ("oidn" if "pyoidn" in sys.modules else "nonlocal_means")


def test_pixels_without_error_stay(denoiser) -> None:
    """Bit for bit, and they alone, but one that agrees by chance; the others have the mean that they had."""
    image, _ = scene_like()
    exact = np.zeros((48, 64), bool)
    exact[:20, 30:], exact[40, 3] = True, True
    image.rgb[exact] *= np.float32(1.7)
    image.standard_error[exact] = 0
    exact[40, 3] = exact[19, 30] = False  # alone, and at a corner
    found = image.denoise(denoiser)
    assert np.array_equal((found.rgb == image.rgb).all(2), exact)
    assert found.rgb[~exact].mean() == pytest.approx(image.rgb[~exact].mean(), rel=1e-5)


def test_what_counts_as_clean() -> None:
    """Errors that nobody sees, unless they are small by chance; neither blacks nor unknown errors."""
    rgb, error = np.full((20, 20, 3), 0.5, np.float32), np.full((20, 20, 3), 0.01, np.float32)
    error[:8], error[12, 12], error[15, 15] = 4e-4, 4e-4, 0
    rgb[:, :4], error[:, :4] = 0, 0
    error[0, 10, 1], error[0, 11] = 6e-4, np.nan
    expected = np.zeros((20, 20), bool)
    expected[:8, 4:], expected[0, 10:12] = True, False
    expected[7, 4] = False  # 4 of 9 agree
    found = noisy_picture(rgb, error, {}, {}).clean
    assert np.array_equal(found, expected)
    assert not noisy_picture(rgb, None, {}, {}).clean.any()


def test_guides_help(denoiser) -> None:
    image, exact = scene_like()
    alone = wf.Image(image.rgb, standard_error=image.standard_error).denoise(denoiser)
    assert relative_mse(image.denoise(denoiser), exact) < 0.8 * relative_mse(alone, exact)


def test_networks_of_open_image_denoise(calls_of) -> None:
    """A picture of few samples takes one; others, and those whose samples are not known, clean guides."""
    pytest.importorskip("pyoidn")
    runs = calls_of("wavefront.denoising.open_image_denoise._run")
    guides = {f"denoising_{name}": np.full((64, 64, 3), 0.5, np.float32) for name in ("albedo", "normal")}
    whole = ("color", "albedo", "normal")
    for spp, clean in ((1, False), (module.FEW - 1, False), (module.FEW, True), (0, True)):
        runs.clear()
        wf.Image(np.full((64, 64, 3), 0.5, np.float32), spp, layers=guides).denoise("oidn")
        taken = [(*run.args[1], run.named.get("cleanAux")) for run in runs]
        assert taken == [*([("albedo", None), ("normal", None)] if clean else []), (*whole, clean)]
    runs.clear()
    wf.Image(np.full((64, 64, 3), 0.5, np.float32), 64).denoise("oidn")
    assert [(*run.args[1], run.named["cleanAux"]) for run in runs] == [("color", False)]


@pytest.mark.slow
def test_large_pictures_go_through_in_parts(monkeypatch) -> None:
    """With the same bits, in less memory. Open Image Denoise does not divide small ones."""
    pytest.importorskip("pyoidn")
    noise = np.random.default_rng(0).random((1000, 1600, 3), np.float32)
    guides = {"denoising_albedo": noise[::-1], "denoising_normal": noise[:, ::-1]}
    image = wf.Image(noise, 4, layers=guides)
    found = []
    for memory in (10_000, 300):
        monkeypatch.setattr(module, "MOST_MEMORY", memory)
        found.append(image.denoise("oidn").rgb)
    assert (found[0] == found[1]).all()


def test_noisy_stays(denoiser, tmp_path) -> None:
    """With all layers and errors, in files as well; it is denoised anew, not twice."""
    image, _ = scene_like()
    found = image.denoise(denoiser)
    assert image.noisy is None
    for kept in (found, again(found, tmp_path / "x.exr"), again(found, tmp_path / "x.npz")):
        assert (kept.rgb == found.rgb).all()
        assert kept.standard_error is None
        noisy = kept.noisy
        assert (noisy.rgb == image.rgb).all()
        assert (noisy.standard_error == image.standard_error).all()
        assert noisy.metadata == {**image.metadata, "before_denoising": True}
        for name, layer in image.layers.items():
            assert (noisy.layers[name] == layer).all()
            assert (noisy.errors[name] == image.errors[name]).all()
            assert (kept.layers[name] == layer).all()
        assert (kept.denoise(denoiser).rgb == found.rgb).all()
        comparison = wf.compare(kept, image)
        assert comparison.p_value == 1
        assert "of the samples, before denoising" in comparison.shared
        assert (kept.mean().value == image.mean().value).all()


def again(image, path):
    image.save(path)
    return wf.Image.load(path)


@pytest.mark.parametrize("size", [(1, 1), (1, 9), (2, 3), (70, 5)])
def test_small_pictures(denoiser, size) -> None:
    image, _ = scene_like(size)
    found = image.denoise(denoiser)
    assert found.rgb.shape == image.rgb.shape
    assert np.isfinite(found.rgb).all()
    assert found.rgb.mean() == pytest.approx(image.rgb.mean(), rel=0.06)


def test_values_that_are_not_finite(denoiser) -> None:
    """Are filled from their neighbors, in the picture, its error and its guides."""
    image, exact = scene_like()
    rng = np.random.default_rng(1)
    for array in (image.rgb, image.standard_error, *image.layers.values(), *image.errors.values()):
        array[rng.random(array.shape) < 0.02] = rng.choice([np.nan, np.inf, -np.inf])
    image.rgb[:9, :9] = np.nan
    found = image.denoise(denoiser)
    assert np.isfinite(found.rgb).all()
    assert relative_mse(found, exact) < 0.4 * relative_mse(scene_like()[0], exact)
    nothing = wf.Image(np.full((4, 5, 3), np.nan, np.float32)).denoise(denoiser)
    assert nothing.rgb == pytest.approx(0, abs=1e-3)


def test_black_and_flat_pictures(denoiser) -> None:
    for value in (0.0, 0.5):
        flat = wf.Image(
            np.full((20, 20, 3), value, np.float32), standard_error=np.zeros((20, 20, 3), np.float32)
        )
        assert flat.denoise(denoiser).rgb == pytest.approx(value, rel=0.05, abs=1e-5)


def test_without_errors(denoiser) -> None:
    """A picture of one sample, or of a file, whose error is not known."""
    image, exact = scene_like()
    for error in (None, np.full_like(image.rgb, np.nan)):
        found = wf.Image(image.rgb, standard_error=error, layers=image.layers).denoise(denoiser)
        assert relative_mse(found, exact) < 0.5 * relative_mse(image, exact)
        assert (found.noisy.standard_error is None) == (error is None)


def test_holes() -> None:
    values = np.arange(24, dtype=np.float32).reshape(4, 2, 3)
    values[1, 0, 2] = np.nan
    filled = without_holes(values)
    others = np.delete(values[:3].reshape(-1, 3), 2, axis=0)
    assert filled[1, 0] == pytest.approx(others.mean(0))
    assert (filled[3] == values[3]).all()
    assert without_holes(filled) is filled


def test_without_pyoidn(missing) -> None:
    """The own filter takes over, and the error says how to install the other."""
    image, _ = scene_like((8, 8))
    missing("pyoidn")
    assert image.denoise().metadata["denoiser"] == "nonlocal_means"
    with pytest.raises(wf.SceneError, match="pip install pyoidn"):
        image.denoise("oidn")
    with pytest.raises(wf.SceneError, match="denoiser"):
        image.denoise("median")


@pytest.fixture(scope="module")
def exact_box():
    return render(cornell_box(48), 256, seed=7, max_bounces=5)


def test_render(denoiser, exact_box, missing) -> None:
    """Adds the guides, leaves the noisy picture as it would be, and lowers the error."""
    if denoiser != "oidn":
        missing("pyoidn")
    scene = cornell_box(48)
    plain = render(scene, 16, aovs="depth", max_bounces=5)
    found = render(scene, 16, aovs="depth", max_bounces=5, denoise=True)
    assert found.metadata["denoiser"] == denoiser
    assert (found.noisy.rgb == plain.rgb).all()
    assert (found.noisy.standard_error == plain.standard_error).all()
    assert set(found.noisy.layers) == {"depth", "denoising_albedo", "denoising_normal"}
    assert np.array_equal(found.depth, plain.depth, equal_nan=True)
    assert relative_mse(found, exact_box) < 0.4 * relative_mse(plain, exact_box)
    assert found.rgb.mean() == pytest.approx(plain.rgb.mean(), rel=0.01)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["cornell box", "material sheet", "gltf scene"])
def test_error_at_16_samples(name, tmp_path) -> None:
    """A quarter of the error by Open Image Denoise, half of it by the own filter, against 4096 samples."""
    scene, smooth = {
        "cornell box": lambda: (cornell_box(128), "box"),
        "material sheet": lambda: (material_sheet.scene(192), "gaussian"),
        "gltf scene": lambda: (gltf_scene.scene(tmp_path / "scene.glb", 240), "box"),
    }[name]()
    settings = {"filter": smooth, "lighting": None, "progress": False}
    noisy = wf.render(scene, 16, aovs=("denoising_albedo", "denoising_normal"), **settings)
    exact = wf.render(scene, 4096, seed=1, **settings)
    assert wf.compare(noisy, exact).p_value > 1e-3
    for denoiser, most in (("oidn", 0.25), ("nonlocal_means", 0.5)):
        found = noisy.denoise(denoiser)
        ratio = relative_mse(found, exact) / relative_mse(noisy, exact)
        print(f"{name}, {denoiser}: {ratio:.3f}")
        assert ratio < most
        assert found.rgb.mean() == pytest.approx(noisy.rgb.mean(), rel=0.01)


def test_session() -> None:
    settings = {"size": (16, 12), "lighting": "even", "progress": False, "denoise": True}
    with wf.Session(wf.Sphere((0, 0, 0), 1), 4, **settings) as session:
        images = list(session)
    assert [image.noisy is None for image in images] == [True] * (len(images) - 1) + [False]
    assert (images[-1].rgb == wf.render(wf.Sphere((0, 0, 0), 1), 4, **settings).rgb).all()


def test_command(tmp_path, capsys) -> None:
    path = tmp_path / "ball.ply"
    path.write_text(
        "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
        "element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"
    )
    out = tmp_path / "out.exr"
    options = ["--spp", "4", "--size", "16x12", "--lighting", "even", "--quiet", "--denoise", "-o", str(out)]
    assert main(["render", str(path), *options]) == 0
    assert "before denoising" in capsys.readouterr().out
    image = wf.Image.load(out)
    assert image.metadata["denoiser"] in DENOISERS
    assert image.noisy.standard_error is not None


def test_merging_denoised_pictures() -> None:
    settings = {"size": (8, 6), "lighting": "even", "progress": False}
    ball = wf.Sphere((0, 0, 0), 1)
    one, other = (wf.render(ball, samples=part, denoise=True, **settings) for part in (range(4), range(4, 8)))
    merged = one.merge(other)
    assert (merged.rgb == wf.render(ball, 8, **settings).rgb).all()
    assert merged.noisy is None
    assert "denoiser" not in merged.metadata
    assert merged.denoise().noisy is not None


def test_normals_without_an_albedo(denoiser) -> None:
    scene = wf.Scene(wf.Sphere((0, 0, 0), 1), wf.Environment(1))
    image = wf.render(scene, 16, size=(16, 12), aovs=("denoising_normal",), progress=False)
    assert np.isfinite(image.denoise(denoiser).rgb).all()
