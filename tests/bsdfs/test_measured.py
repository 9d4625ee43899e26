"""Measured materials, of files by the definitions of their formats, against formulas and Mitsuba."""

import warnings
from pathlib import Path

import numpy as np
import pytest
from inside import BaseTexture, Conductor, Measured, normalize, spectrum_rgb
from measurements import adaptive_fields, measured, merl_bytes, reflectance, spectral_fields, tensor_file

import wavefront as wf
from wavefront.testing import check_bsdf

F4 = np.float32
KINDS = ["0", "1", "2", "4", "merl"]
CONDUCTOR = Conductor(1, 1, np.sqrt(0.4), multiscatter=False)
RNG = np.random.default_rng(5)


def directions(n: int, highest: float = 1.0) -> np.ndarray:
    z, phi = RNG.uniform(0.05, highest, n), RNG.uniform(0, 2 * np.pi, n)
    r = np.sqrt(1 - z * z)
    return np.stack([r * np.cos(phi), r * np.sin(phi), z]).astype(F4)


@pytest.mark.parametrize("kind", KINDS[:1] + KINDS[3:])
@pytest.mark.first(1)
def test_contract(kind: str) -> None:
    """χ², the integral of the density, weights, energy, and reciprocity of MERL."""
    check_bsdf(measured(kind), samples=20_000, angles=(60.0,), reciprocal=kind == "merl")


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_contract_with_many_samples(kind: str) -> None:
    check_bsdf(measured(kind), samples=500_000, reciprocal=kind == "merl")


def test_a_wrong_density_is_found() -> None:
    class Wrong(Measured):
        def evaluate(self, wo, wi):
            f, pdf = super().evaluate(wo, wi)
            return f, pdf * F4(0.98)

    wrong = Wrong.from_bytes("wrong", tensor_file(adaptive_fields()))
    with pytest.raises(AssertionError, match="integral of pdf"):
        check_bsdf(wrong, samples=20_000, angles=(30.0,), reciprocal=False)


@pytest.mark.parametrize("kind", ["0", "1", "2", "4"])
def test_values_and_densities_are_those_of_mitsuba(kind: str, tmp_path: Path) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        mi = pytest.importorskip("mitsuba")
        dr = pytest.importorskip("drjit")
    mi.set_variant("llvm_ad_rgb")
    path = tmp_path / "metal.bsdf"
    path.write_bytes(tensor_file(adaptive_fields(int(kind), (0.4, 0.4) if kind == "0" else (0.2, 0.5))))
    theirs = mi.load_dict({"type": "measured", "filename": str(path)})
    n = 10_000
    wo, wi = directions(n), directions(n)
    surface = dr.zeros(mi.SurfaceInteraction3f, n)
    surface.wi = mi.Vector3f(wo)
    f, pdf = wf.Measured(path).evaluate(wo, wi)
    np.testing.assert_allclose(
        f * wi[2], theirs.eval(mi.BSDFContext(), surface, mi.Vector3f(wi)), rtol=1e-4, atol=1e-6
    )
    np.testing.assert_allclose(
        pdf, theirs.pdf(mi.BSDFContext(), surface, mi.Vector3f(wi)), rtol=1e-4, atol=1e-6
    )


def test_values_are_those_that_were_tabulated() -> None:
    """The metal of which the tables are, but for the steps of angles."""
    wo, wi = directions(4000, 0.98), directions(4000, 0.98)
    f = Measured.from_bytes("fine.bsdf", tensor_file(adaptive_fields(fine=3))).f(wo, wi)
    facets = CONDUCTOR.facets().mirror_lobe(wo, wi)[0]
    cos = (wo * normalize(wo + wi)).sum(0)
    tint = np.array([[0.9], [0.6], [0.3]]) + np.array([[0.1], [0.4], [0.7]]) * (1 - cos) ** 5
    assert np.abs(f - tint * facets).mean() < 0.01 * f.mean()
    assert f.mean(1) == pytest.approx((tint * facets).mean(1), rel=0.01)


def test_values_of_merl_are_linear_between_cells() -> None:
    wo, wi = directions(4000), directions(4000)
    half = normalize(wo + wi)
    due = np.stack([reflectance(wo, wi, half, 0.3, base) for base in (0.1, 0.3, 0.6)])
    f = measured("merl").f(wo, wi)
    inside = (wo[2] > 0.15) & (wi[2] > 0.15)  # near the horizon what was not measured counts as black
    np.testing.assert_allclose(f[:, inside], due[:, inside], rtol=5e-3)


def test_cells_of_merl_have_their_values_at_their_centers() -> None:
    """Values that grow with the numbers of cells do so in between: θh by its root, θd and φd evenly."""
    numbers = np.meshgrid(np.arange(90), np.arange(90), np.arange(180), indexing="ij")
    table = 100 + numbers[0] + 0.5 * numbers[1] + 0.25 * numbers[2]
    bsdf = Measured.from_bytes("steps.binary", merl_bytes()[:12] + np.stack([table] * 3).tobytes())
    wo, wi = directions(4000).astype(float), directions(4000).astype(float)
    half = wo + wi
    half /= np.linalg.norm(half, axis=0)
    turn = np.arctan2(half[1], half[0])
    cos, sin, level = np.cos(turn), np.sin(turn), np.hypot(half[0], half[1])
    x = (cos * wi[0] + sin * wi[1]) * half[2] - wi[2] * level
    y = cos * wi[1] - sin * wi[0]
    tilt = np.arccos(half[2]) / (np.pi / 2)
    up = np.arccos(np.minimum((wi * half).sum(0), 1)) / (np.pi / 2)
    cells = 90 * np.sqrt(tilt) - 0.5, 90 * up - 0.5, np.arctan2(y, x) % np.pi / np.pi * 180 - 0.5
    due = (100 + cells[0] + 0.5 * cells[1] + 0.25 * cells[2]) * np.array([[1], [1.15], [1.66]]) / 1500
    inside = (cells[0] > 0) & (cells[0] < 89) & (cells[1] > 0.5) & (cells[2] > 0) & (cells[2] < 179)
    assert inside.sum() > 3000
    f = bsdf.f(wo.astype(F4), wi.astype(F4))
    np.testing.assert_allclose(f[:, inside], due[:, inside], rtol=1e-5)  # 0.001 of a cell


def test_samples_of_merl_have_little_noise() -> None:
    """Densities by the table's own values, for views between and beside the tabulated ones."""
    u = np.random.default_rng(0).random((2, 10_000), dtype=F4)
    for angle in np.radians([0, 20, 50, 75, 85]):
        wo = np.repeat(F4([[np.sin(angle)], [0], [np.cos(angle)]]), u.shape[1], 1)
        weight = measured("merl").sample_f(wo, u).weight.mean(0, dtype=float)
        assert weight.std() < 0.25 * weight.mean()


def test_merl_is_scaled_by_channel_and_black_where_nothing_was_measured() -> None:
    table = np.full((3, 90, 90, 180), 100.0)
    table[:, 0] = -1
    bsdf = Measured.from_bytes("flat.binary", merl_bytes()[:12] + table.tobytes())
    wo = np.array([[0.6, 0], [0, 0], [0.8, 1]], F4)
    wi = np.array([[0.6, 0], [0, 0], [0.8, 1]], F4)
    f = bsdf.f(wo, wi)
    np.testing.assert_allclose(f[:, 0], [100 / 1500, 115 / 1500, 166 / 1500], rtol=1e-6)
    assert not f[:, 1].any()
    assert bsdf.sample_f(wo, np.full((2, 2), 0.5, F4)).pdf.all()


def test_tables_of_normals_may_be_divided_out() -> None:
    """jacobian: whether the value is in proportion to the density of normals."""
    fields = adaptive_fields(weighted=False)
    wo, wi = directions(100), directions(100)
    plain = Measured.from_bytes("plain.bsdf", tensor_file(fields)).f(wo, wi)
    weighted = Measured.from_bytes("weighted.bsdf", tensor_file(fields | {"jacobian": np.uint8([1])}))
    from wavefront.bsdfs.measured import UP, _coordinates, _elevation

    data, m = weighted.data, normalize(wo + wi)
    ndf = data.ndf.at(_coordinates(m, _elevation(m, UP)))
    sigma = data.sigma.at(_coordinates(wo, _elevation(wo, UP)))
    np.testing.assert_allclose(weighted.f(wo, wi), plain * ndf / (4 * sigma), rtol=1e-5)


def test_spectra_are_colors_under_d65() -> None:
    waves = np.linspace(360, 1000, 65)
    spectrum = 0.5 + 0.4 * np.sin(waves / 100)
    wo, wi = directions(50), directions(50)
    gray = Measured.from_bytes("s.bsdf", tensor_file(spectral_fields((waves, np.ones(65))))).f(wo, wi)
    f = Measured.from_bytes("s.bsdf", tensor_file(spectral_fields((waves, spectrum)))).f(wo, wi)
    np.testing.assert_allclose(gray, np.repeat(measured("0").f(wo, wi)[:1], 3, 0), rtol=1e-5)
    due = spectrum_rgb(list(zip(waves, spectrum, strict=True)), emission=False, bounded=False)
    np.testing.assert_allclose(f / gray, np.repeat(due[:, None], 50, 1), rtol=0.01)
    green = Measured.from_bytes(
        "g.bsdf", tensor_file(spectral_fields((waves, (abs(waves - 500) < 30) * 1.0)))
    )
    assert (green.f(wo, wi)[0] == 0).all()  # out of gamut: red would be negative
    assert (green.f(wo, wi)[1] > 0).all()


@pytest.mark.parametrize("kind", ["2", "4"])
def test_azimuths_that_are_left_out_are_mirrored(kind: str) -> None:
    """Of azimuths from −180° to 0° or to −90°, which are those of the file with all of them."""
    bsdf, wo, wi = measured(kind), directions(500), directions(500)
    assert bsdf.rotation == 0
    wo[:2] = -np.abs(wo[:2])
    for part, whole in zip(bsdf.evaluate(wo, wi), measured("1").evaluate(wo, wi), strict=True):
        np.testing.assert_allclose(part, whole, rtol=1e-4, atol=1e-5)
    for signs in ((-1, -1, 1), (-1, 1, 1), (1, -1, 1))[: 1 if kind == "2" else 3]:
        flip = np.array(signs, F4)[:, None]
        np.testing.assert_allclose(bsdf.f(wo * flip, wi * flip), bsdf.f(wo, wi), rtol=1e-4, atol=1e-5)


@pytest.mark.parametrize("kind", ["1", "2", "4"])
def test_views_along_the_axes_of_tables_are_those_beside_them(kind: str) -> None:
    """Where azimuths begin and end, and others are mirrored."""
    bsdf, wi = measured(kind), directions(200)
    for x, y in ((0.6, 0.0), (-0.6, 0.0), (0.0, 0.6), (0.0, -0.6)):
        on, beside = (np.repeat(F4([[x - off], [y + off], [0.8]]), 200, 1) for off in (0, 1e-6))
        np.testing.assert_allclose(bsdf.f(on, wi), bsdf.f(beside, wi), rtol=2e-3, atol=1e-4)


def test_nothing_that_merl_has_is_left_out_by_its_samples() -> None:
    """Not what lies between the tabulated views; nor is a black material an error."""
    table = np.zeros((3, 90, 90, 180))
    dark = Measured.from_bytes("dark.binary", merl_bytes()[:12] + table.tobytes())
    table[:, :, 44] = 1000
    ring = Measured.from_bytes("ring.binary", merl_bytes()[:12] + table.tobytes())
    wo, wi = directions(20_000), directions(20_000)
    f, pdf = ring.evaluate(wo, wi)
    assert (f > 0).any()
    assert (pdf[f[0] > 0] > 0).all()
    assert not dark.sample_f(wo, directions(20_000)[:2] * F4(0.5) + F4(0.5)).weight.any()


def test_rotation_turns_anisotropic_materials() -> None:
    """By degrees from the tangent; the roughness of the tables is 0.2 along it and 0.5 across."""
    bsdf, wo = measured("1"), np.array([[0], [0], [1]], F4)
    turned = Measured.from_bytes("t", tensor_file(adaptive_fields(1, (0.2, 0.5))))
    turned.rotation = 90
    x, y = np.array([[0.5], [0], [0.866]], F4), np.array([[0], [0.5], [0.866]], F4)
    surface = wf.testing.bsdf._surface(wo, np.array([False]))
    along, across = (bsdf.bind(surface).f(wo, w)[0, 0] for w in (x, y))
    assert across > 1.5 * along
    assert turned.bind(surface).f(wo, x)[0, 0] == pytest.approx(across, rel=0.01)
    assert isinstance(bsdf.tangent, BaseTexture)
    assert measured("0").tangent is None
    with pytest.raises(wf.SceneError, match="rotation is inf; it must be finite"):
        turned.rotation = np.inf


def test_a_picture_has_the_albedo() -> None:
    bsdf = measured("0")
    ball = wf.Sphere((0, 0, 0), 1, material=bsdf)
    camera = wf.Camera.look_at((0, 0, 50), (0, 0, 0), fov=0.02, size=(8, 8))
    image = wf.render(wf.Scene(ball, [wf.Environment(1)], camera=camera), 256, workers=1)
    wo = np.repeat(np.array([[0], [0], [1]], F4), 4096, 1)
    due = bsdf.sample_f(wo, np.random.default_rng(1).random((2, 4096), F4)).weight.mean(1)
    np.testing.assert_allclose(image.rgb.mean((0, 1)), due, rtol=0.01)


FIELDS = {
    "vndf": (
        {"vndf": np.zeros((1, 8, 1, 4), F4)},
        r"byte \d+: field 'vndf' has shape \(1, 8, 1, 4\); it must",
    ),
    "dark": ({"luminance": np.zeros((1, 8, 16, 16), F4)}, "slice 0 is 0 everywhere"),
    "oblong": ({"luminance": np.ones((1, 8, 16, 8), F4)}, "must be square"),
    "type": ({"ndf": np.ones((4, 4), np.float64)}, "field 'ndf' has type 11; it must be f4"),
    "falling": ({"theta_i": np.linspace(1, 0, 8).astype(F4)}, "'theta_i' does not rise"),
    "finite": ({"sigma": np.full((4, 4), np.nan, F4)}, r"'sigma' has nan at byte \d+; it must be finite"),
    "rgb": ({"rgb": np.ones((1, 8, 4, 16, 16), F4)}, r"'rgb' has shape .* \(1, 8, 3, 16, 16\)"),
}


@pytest.mark.parametrize("case", FIELDS)
def test_wrong_fields_are_named(case: str) -> None:
    fields, message = FIELDS[case]
    with pytest.raises(wf.SceneError, match=r"metal\.bsdf.*" + message):
        Measured.from_bytes("metal.bsdf", tensor_file(adaptive_fields() | fields))


def test_missing_fields_and_claims_beyond_the_file_are_refused() -> None:
    fields = adaptive_fields()
    with pytest.raises(wf.SceneError, match="m: has no field 'ndf'"):
        Measured.from_bytes("m", tensor_file({k: v for k, v in fields.items() if k != "ndf"}))
    data = bytearray(tensor_file(fields))
    at = data.index(b"phi_i") + 5 + 11
    data[at : at + 8] = (2**60).to_bytes(8, "little")
    with pytest.raises(wf.SceneError, match=r"'phi_i' needs \d+ bytes at byte \d+; \d+ are there"):
        Measured.from_bytes("m", bytes(data))
    with pytest.raises(wf.SceneError, match=r"version is 2\.0"):
        Measured.from_bytes("m", b"tensor_file\0\2" + bytes(data[13:]))
    with pytest.raises(wf.SceneError, match="MERL file must have 34992012"):
        Measured.from_bytes("m", merl_bytes()[:-1])
    broken = merl_bytes()[:12] + np.float64(np.nan).tobytes() + merl_bytes()[20:]
    with pytest.raises(wf.SceneError, match="byte 12: value is nan"):
        Measured.from_bytes("m", broken)
    with pytest.raises(wf.SceneError, match="neither like"):
        Measured.from_bytes("m", b"P6 1 1 255 xxx")


def test_damaged_files_give_a_material_or_a_typed_error() -> None:
    """Bytes changed in the list of fields, in the tables, and files cut off."""
    data, wo = tensor_file(adaptive_fields()), directions(20)
    rng, refused = np.random.default_rng(2), 0
    for _ in range(150):
        mutated = np.frombuffer(data, np.uint8).copy()
        places = rng.integers(0, 400 if rng.random() < 0.8 else len(data), rng.integers(1, 4))
        mutated[places] = rng.integers(0, 256, len(places))
        cut = len(data) if rng.random() < 0.8 else int(rng.integers(0, len(data)))
        try:
            bsdf = Measured.from_bytes("fuzz", mutated[:cut].tobytes())
        except wf.SceneError:
            refused += 1
            continue
        with np.errstate(all="ignore"):
            bsdf.sample_f(wo, rng.random((2, 20), F4))
    assert 20 < refused < 150
