"""What the tutorial's exercises promise: each is done as it says, and what comes out is measured."""

import ast
import sys
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest

import wavefront as wf

FOLDER = Path(__file__).parents[2] / "docs" / "tutorial"
WIDTH, HEIGHT = 32, 24
MATTE_BALL, MIRROR_BALL, GLASS_BALL, LAMP = 6, 7, 8, 9
POWER = "p**2 / (np.where(np.isinf(p), 1, p) ** 2 + q**2)"


def replaced(path, changes):
    """Return the text of a file in which each text is replaced that a reader is told to replace."""
    text = path.read_text("utf-8")
    for old, new in changes.items():
        assert old in text, f"{path.name}: {old}"
        text = text.replace(old, new)
    return text


def tracer(changes=()):
    module = ModuleType("tracer")
    exec(replaced(FOLDER / "tracer.py", dict(changes)), vars(module))
    return module


@contextmanager
def imported_tracer(changes=()):
    """Have `import tracer` give the tracer of the tutorial, with changes."""
    before, sys.modules["tracer"] = sys.modules.get("tracer"), tracer(changes)
    try:
        yield
    finally:
        del sys.modules["tracer"]
        if before is not None:
            sys.modules["tracer"] = before


def step(number, changes=(), of_tracer=()):
    """Return the functions and constants of a step, with changes to it and to the tracer."""
    (path,) = FOLDER.glob(f"{number:02}_*.py")
    names = {}
    kept = [node for node in ast.parse(replaced(path, dict(changes))).body if defines(node)]
    with imported_tracer(of_tracer):
        exec(compile(ast.Module(kept, []), str(path), "exec"), names)
    return SimpleNamespace(**names)


def defines(node):
    if isinstance(node, ast.Assign):
        return all(name.id.isupper() for name in ast.walk(node.targets[0]) if isinstance(name, ast.Name))
    return isinstance(node, ast.Import | ast.ImportFrom | ast.FunctionDef)


PLAIN = tracer()


def seen(module=PLAIN):
    """Return points (n, 3) that the camera sees, and the number of the sphere of each."""
    origin, direction = module.camera_rays(160, 120, np.random.default_rng(0))
    distance, which = module.intersect(origin, direction)
    return origin + distance * direction, which


def lit(module):
    """Return the picture of the point light, (n, 3)."""
    point, which = seen()
    return module.point_light(point, PLAIN.normal_at(point, which), PLAIN.COLOR[which])


def several(estimator, count=40, size=(WIDTH, HEIGHT)):
    """Return independent pictures of one path per pixel, (count, n, 3)."""
    return np.array([PLAIN.render(estimator, *size, 1, seed) for seed in range(count)])


def variance(pictures):
    return pictures.var(0, ddof=1).mean()


def test_1_1_a_field_of_half_the_angle():
    narrow = tracer({"np.radians(60)": "np.radians(30)"})
    wide_area, area = ((seen(module)[1] == MIRROR_BALL).sum() for module in (PLAIN, narrow))
    assert 2.0 < np.sqrt(area / wide_area) < 2.3  # 2.15 by the tangents


def test_1_2_shadow_rays_that_meet_their_own_surface():
    _, which = seen()
    shown = lit(PLAIN).max(1) > 0
    for last, balls, walls in (("t <= 0", (0.4, 0.6), (0, 0.3)), ("t < 0", (0.4, 0.6), (0.8, 1))):
        black = lit(tracer({"root > 1e-4": "root > 0", "t < 1e-4": last})).max(1) == 0
        for chosen, (low, high) in (((which > 5) & (which < LAMP), balls), (which < 6, walls)):
            assert low <= black[shown & chosen].mean() <= high


def test_1_3_the_arithmetic_of_a_picture():
    """Of ten spheres: two products of vectors, and some ten operations more, for each of a million rays."""
    assert 1e6 * 10 * (2 * 5 + 20) == 3e8
    assert 100_000 / 10 == 1e4


def test_2_1_without_shadow_rays():
    _, which = seen()
    everywhere = step(2, {" * cos * seen": " * cos"})
    dark = [lit(module)[which == 0].max(1) == 0 for module in (PLAIN, everywhere)]
    assert dark[0].mean() > 0.05
    assert not dark[1].any()


def test_2_2_division_by_the_distance():
    assert 45 < lit(step(2, {"/ distance**2": "/ distance"})).mean() / lit(PLAIN).mean() < 65


def test_2_3_the_code_of_half_the_radiance_of_white():
    assert PLAIN.picture(np.full((1, 3), 0.5), 1, 1).ravel().tolist() == [186] * 3


def test_3_1_a_mirror_with_the_cosine():
    """The quotient is the cosine, a half where the sine is 0.87, and next to 0 at the rim."""
    cosine = "* np.abs(dot(direction, normal))[these]"
    changes = {
        "direction = np.where(these": "before = direction; direction = np.where(these",
        "COLOR[which[these]]": f"COLOR[which[these]] {cosine}".replace("direction", "before"),
    }
    origin, direction = PLAIN.camera_rays(160, 120, np.random.default_rng(0))
    point, which = seen()
    plain, darker = (
        each.followed(origin, direction, np.random.default_rng(1), 1) for each in (step(3), step(3, changes))
    )
    shown = (which == MIRROR_BALL) & (plain.min(1) > 0)
    assert shown.sum() > 100
    cos = -PLAIN.dot(direction, PLAIN.normal_at(point, which))[shown]
    np.testing.assert_allclose(darker[shown] / plain[shown], np.broadcast_to(cos, (len(cos), 3)))
    assert cos.min() < 0.3
    assert np.sqrt(1 - 0.87**2) == pytest.approx(0.5, abs=0.01)


def test_3_2_glass_of_index_1():
    rng = np.random.default_rng(0)
    direction, normal = (PLAIN.unit(rng.normal(size=(100, 3))) for _ in range(2))
    np.testing.assert_allclose(step(3).through_glass(direction, normal, rng, index=1.0), direction)


def test_3_3_the_shadow_of_glass_is_black():
    point, which = seen()
    lamp = PLAIN.CENTER[LAMP] - point
    first = PLAIN.intersect(point, PLAIN.unit(lamp))[1]
    behind = (which == 0) & (first == GLASS_BALL)
    assert behind.sum() > 100
    assert not lit(PLAIN)[behind].any()


def test_glass_follows_the_equations_of_fresnel_and_snell():
    """The part that is reflected is the mean of both polarizations, by their formulas with angles."""
    normal, count = np.array([[0.0, 0, 1]]), 40_000
    for index, angle in ((1.5, 0.2), (1.5, 1.2), (1 / 1.5, 0.6)):
        toward = np.array([[np.sin(angle), 0, -np.cos(angle)]]) * (1 if index > 1 else -1)
        after = PLAIN.through_glass(
            toward.repeat(count, 0), normal.repeat(count, 0), np.random.default_rng(0), 1.5
        )
        refracted = np.arcsin(np.sin(angle) / index)
        s = np.sin(angle - refracted) / np.sin(angle + refracted)
        p = np.tan(angle - refracted) / np.tan(angle + refracted)
        exact = (s * s + p * p) / 2
        back = after[:, 2] * toward[0, 2] < 0
        assert abs(back.mean() - exact) < 4.5 * np.sqrt(exact / count)
        np.testing.assert_allclose(np.abs(after[~back, 0]), np.sin(refracted))


def light_by_reflections(estimator):
    """Return the mean light of paths by their reflections before the last: of 0, 1 and 2."""
    means = [several(lambda o, d, r, n=n: estimator(o, d, r, n), 4).mean() for n in range(3)]
    return np.diff(means, prepend=0)


def test_4_1_a_density_of_1():
    """Where all is matte; the random numbers are the same, and so is the noise."""
    kinds = "np.array([MATTE] * 6 + [MATTE, MIRROR, GLASS, MATTE, MATTE])"
    four = step(4, of_tracer={kinds: "np.zeros(11, int)"})
    right, wrong = (
        light_by_reflections(four.paths(four.uniform_directions, lambda cos, p=p: p))
        for p in (1 / (2 * np.pi), 1)
    )
    np.testing.assert_allclose(right / wrong, [1, 6.283, 39.48], rtol=1e-3)


def test_4_2_uniform_and_cosine_weighted_directions():
    four = step(4)
    uniform = variance(several(four.paths(four.uniform_directions, lambda cos: 1 / (2 * np.pi)), 40))
    cosine = variance(several(four.paths(four.cosine_directions, lambda cos: cos / np.pi), 40))
    assert 1.7 < uniform / cosine < 2.4


def test_4_3_a_density_that_is_not_that_of_the_directions():
    """The weight is the reflectance, as of a material whose f is ρ/(2π·cosθ)."""
    four = step(4)
    z = four.uniform_directions(np.random.default_rng(0).random((2, 1000)))[:, 2]
    weight = 0.5 / np.pi * z / (z / np.pi)
    other = 0.5 / (2 * np.pi * z) * z / (1 / (2 * np.pi))
    np.testing.assert_allclose(weight, other)


def test_5_1_a_lamp_of_twice_the_radius():
    large = tracer({"10, 10, 10, 5]": "10, 10, 10, 10]"})
    ratio = variance(several(large.naive, 60)) / variance(several(PLAIN.naive, 60))
    assert 0.18 < ratio < 0.32


def test_5_2_light_by_its_reflections():
    text = {"light = light + throughput": "light = throughput"}  # of the last sphere alone
    last = tracer(text).naive
    light = [
        PLAIN.render(lambda o, d, r, n=n: last(o, d, r, n), WIDTH, HEIGHT, 80).mean() for n in range(1, 5)
    ]
    assert all(0.5 < ratio < 0.8 for ratio in np.divide(light[1:], light[:-1]))


def test_6_1_points_on_the_whole_lamp():
    point, _ = seen()
    z, turn = np.random.default_rng(0).random((2, len(point))) * [[2], [2 * np.pi]] - [[1], [0]]
    radius = np.sqrt(1 - z * z)
    normal = np.stack([radius * np.cos(turn), radius * np.sin(turn), z], 1)
    away = point - (PLAIN.CENTER[LAMP] + PLAIN.RADIUS[LAMP] * normal)
    assert 0.5 < (PLAIN.dot(normal, away) < 0).mean() < 0.6


def test_6_2_a_large_lamp_has_wide_shadows():
    """Points of the floor that some samples of the lamp reach, and some do not."""
    point, which = seen()
    floor = point[which == 0][::7]
    normal = PLAIN.normal_at(floor, np.zeros(len(floor), int))
    half = []
    for radius in (5, 12):
        six = step(6, of_tracer={"10, 10, 10, 5]": f"10, 10, 10, {radius}]"})
        rng = np.random.default_rng(0)
        reached = np.mean([six.light_sample(floor, normal, 1.0, rng)[0].max(1) > 0 for _ in range(32)], 0)
        half.append(((reached > 0) & (reached < 1)).mean())
    assert half[1] > 2 * half[0]


def test_7_1_the_balance_heuristic():
    power, balance = (
        several(step(7, changes).direct_mis, 20)
        for changes in ({}, {POWER: "p / (np.where(np.isinf(p), 1, p) + q)"})
    )
    assert balance.mean() == pytest.approx(power.mean(), rel=2e-3)
    assert variance(balance) / variance(power) == pytest.approx(1, abs=0.01)


def test_7_2_weights_that_do_not_add_up():
    one, half = (
        several(step(7, {POWER: f"np.where(np.isinf(p), 1, {weight}) + 0 * q"}).direct_mis, 40)
        for weight in ("1", "0.5")
    )
    light = several(step(6).direct_simple, 40)
    _, which = PLAIN.intersect(*PLAIN.camera_rays(WIDTH, HEIGHT, np.random.default_rng(0)))
    matte = which < LAMP - 2
    error = half[:, matte].mean((1, 2)).std() / np.sqrt(40)
    assert abs(half[:, matte].mean() - light[:, matte].mean()) < 4 * error
    assert abs(one[:, matte].mean() - 2 * light[:, matte].mean()) < 4 * 2 * error
    assert 4 < variance(half) / variance(light) < 9


def test_8_1_roulette():
    rays = [0]

    def counted(origin, direction):
        rays[0] += len(origin)
        return PLAIN.intersect(origin, direction)

    other = tracer()
    other.intersect = counted
    found = []
    for first in (2, 9):
        rays[0] = 0
        pictures = several(
            lambda o, d, r, first=first: other.full(o, d, r, first_roulette=first), size=(48, 36)
        )
        found.append((rays[0], variance(pictures)))
    assert 0.6 < found[0][0] / found[1][0] < 0.75
    assert 1 < found[0][1] / found[1][1] < 1.5


def test_8_2_roulette_without_its_division():
    dark = tracer({" / np.minimum(stay[alive], 1)[:, None]": ""})
    assert 0.84 < several(dark.full).mean() / several(PLAIN.full).mean() < 0.92


def test_8_3_the_lamp_only_by_light_samples():
    """Mirror and glass no longer show it, nor does its caustic."""
    met = "power(pdf, lamp_pdf(origin))\n        if"
    no_lamp = tracer({met: f"np.isfinite(pdf) * {met}"})
    _, which = PLAIN.intersect(*PLAIN.camera_rays(WIDTH, HEIGHT, np.random.default_rng(0)))
    darker, plain = several(no_lamp.full), several(PLAIN.full)
    brightest = [pictures[:, which == 0].max() for pictures in (darker, plain)]
    assert brightest[0] < 0.5 * brightest[1]
    assert darker.mean() < plain.mean()


def room(*more):
    """Return the scene of step 9."""
    (path,) = FOLDER.glob("09_*.py")
    text, _, _ = path.read_text("utf-8").partition("library = ")
    names = {}
    with imported_tracer():
        exec(text, names)
    return wf.Scene([*names["spheres"], *more], camera=names["scene"].camera)


def test_9_1_where_the_samples_go():
    counts = wf.render(room(), noise=0.15, max_bounces=5, workers=1, progress=False).counts.reshape(48, 64)
    assert (counts[40:] == 32).all()
    assert np.median(counts[:40]) == 48


def test_9_2_a_mesh_in_the_room():
    trimesh = pytest.importorskip("trimesh")
    ball = trimesh.creation.icosphere(subdivisions=4)
    assert len(ball.faces) == 5120
    assert len(ball.subdivide().faces) == 4 * 5120
    scene = room(wf.Mesh(8 * ball.vertices + (-2, -2, 14), ball.faces))
    seen = wf.render(scene, 1, size=(32, 24), aovs="shape_id", progress=False).shape_id
    assert (seen == len(scene.shapes) - 1).mean() > 0.03


def test_9_3_a_bsdf_of_ones_own_is_checked():
    report = wf.testing.check_bsdf(wf.Diffuse(0.5), samples=20_000)
    assert all(check.passed for check in report.checks.values())


def one_iteration(changes=()):
    """Return the names of step 10, as far as its scene."""
    (path,) = FOLDER.glob("10_*.py")
    names = {}
    exec(replaced(path, dict(changes)).partition("# %%")[0], names)
    return names


def test_10_1_a_mirror_comes_last():
    mirror = {"material=wf.Diffuse((0.9, 0.5, 0.2))": "material=wf.Mirror(0.9)"}
    scene = one_iteration(mirror)["scene"]
    _, _, compacted, shaded, direct, *_ = wf.trace(scene, max_bounces=1)
    specular = np.abs(shaded.surface.point[1]) > 1e-3  # the balls; the floor and the lamp are matte
    specular &= shaded.surface.point[1] < 2.9
    assert specular[np.argmax(specular) :].all()
    at = shaded.paths.pixel[specular]
    np.testing.assert_array_equal(direct.light[:, at], compacted.light[:, at])


def test_10_2_roulette_ends_paths_from_the_third_surface_on():
    steps = list(wf.trace(one_iteration()["scene"], max_bounces=20))
    left = {step.bounce: len(step.paths) for step in steps if step.stage == "bounce-sample"}
    onward = {step.bounce - 1: len(step.paths) for step in steps if step.stage == "intersect"}
    assert [onward[k] == left[k] for k in (0, 1, 2, 3)] == [True, True, False, False]
