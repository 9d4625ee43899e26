"""Records of columns: take, concatenate, compact and roulette keep every column whole."""

from dataclasses import fields, replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import scenes
import strategies
from hypothesis import given
from hypothesis import strategies as st
from inside import (
    ROULETTE_AFTER,
    Branches,
    CompiledScene,
    Frame,
    Hits,
    NumpyAccelerator,
    Paths,
    Program,
    SurfaceInteraction,
    broadcast,
    compile_scene,
    f4,
    make_sampler,
    normalize,
    shading,
)
from inside import compact as stage
from significance import render

import wavefront as wf

SHAPES = {
    Paths: {"origin": 3, "direction": 3, "throughput": 3, "vertex": 3},
    Hits: {},
    SurfaceInteraction: {"point": 3, "ng": 3, "ns": 3, "wo": 3, "uv": 2},
}
KINDS = {
    **dict.fromkeys(("slot", "exclude_prim", "prim", "material"), np.intp),
    **dict.fromkeys(("pixel", "sample"), np.uint32),
    **dict.fromkeys(("specular", "back_facing"), np.bool_),
}


def record(kind: type, n: int, seed: int = 0, absent: tuple[str, ...] = ()):
    """A record of n columns, every one different."""
    rng = np.random.default_rng(seed)
    values = {}
    for field in fields(kind):
        rows = SHAPES[kind].get(field.name)
        shape = (n,) if rows is None else (rows, n)
        values[field.name] = (rng.random(shape) * 1000).astype(KINDS.get(field.name, f4))
    return kind(**{**values, **dict.fromkeys(absent)})


def same(a, b) -> bool:
    """Whether two records have the same bits."""
    return all(
        (x is None and y is None)
        or (x.dtype == y.dtype and x.shape == y.shape and x.tobytes() == y.tobytes())
        for x, y in ((getattr(a, f.name), getattr(b, f.name)) for f in fields(a))
    )


kinds = st.sampled_from([Paths, Hits, SurfaceInteraction])


@given(kinds, st.integers(1, 12), st.data())
def test_take_takes_every_field(kind: type, n: int, data) -> None:
    """Column i of the result is column index[i] of the record, in every field; slices do the same."""
    whole, index = record(kind, n), data.draw(strategies.index_lists(n))
    part = whole.take(index)
    assert len(part) == len(index)
    assert same(whole.take(slice(1, n - 1)), whole.take(np.arange(1, max(1, n - 1))))
    for field in fields(kind):
        before, after = getattr(whole, field.name), getattr(part, field.name)
        assert after.dtype == before.dtype
        assert (after == before[..., index]).all()


@given(kinds, st.integers(2, 12), st.data())
def test_concatenate_undoes_cutting(kind: type, n: int, data) -> None:
    whole, cut = record(kind, n), data.draw(st.integers(1, n - 1))
    halves = whole.take(np.arange(cut)), whole.take(np.arange(cut, n))
    assert same(kind.concatenate(halves), whole)


MIRROR, GREY, GLASS, GOLD = (
    wf.Mirror(),
    wf.Diffuse(0.5),
    wf.Dielectric(),
    wf.Conductor.named("gold", roughness=0.3),
)


def balls(*materials: wf.Bsdf) -> CompiledScene:
    """A ball of each material, far apart."""
    shapes = [wf.Sphere((5 * i, 0, 0), 1, material=material) for i, material in enumerate(materials)]
    return compile_scene(wf.Scene(shapes, [wf.Environment()]), NumpyAccelerator)


SPENT = ("exclude_prim", "pdf", "prev_vertex", "left_receiver")


@given(
    st.sampled_from([(GREY,), (GREY, GREY, wf.Diffuse(0.1)), (MIRROR, GREY, GLASS, GOLD, GREY)]),
    st.integers(1, 12),
    st.data(),
)
def test_compact_keeps_paths_and_hits_together(materials: tuple[wf.Bsdf, ...], n: int, data) -> None:
    """The same lanes of both, by groups of materials and else in order; delta lobes come last.

    What nobody reads after the hit need not be kept.
    """
    scene = balls(*materials)
    paths, hits = record(Paths, n, 1), record(Hits, n, 2)
    paths.slot = np.arange(n)
    met = st.integers(-1, len(materials) - 1)
    hits.prim = np.array(data.draw(st.lists(met, min_size=n, max_size=n)))
    kept_paths, kept_hits = stage.compact(scene, paths, hits, hits.found)
    assert sorted(kept_paths.slot) == hits.found.tolist()
    expected = paths.take(kept_paths.slot)
    spent = {name: getattr(expected, name) for name in SPENT}
    assert same(replace(kept_paths, **spent), expected)
    assert same(kept_hits, hits.take(kept_paths.slot))
    group = scene.materials.group_of.take(scene.material_of.take(kept_hits.prim))
    assert (np.diff(group * n + kept_paths.slot) > 0).all()
    specular = [materials[prim].specular for prim in kept_hits.prim]
    assert specular == sorted(specular)


def test_light_is_sampled_only_where_it_can_be_scattered() -> None:
    """No light sample is drawn for lanes that have only delta lobes; all others keep their columns."""
    scene = balls(MIRROR, GREY, GLASS, GOLD, GREY)
    surface = record(SurfaceInteraction, 8)
    surface.material = np.array([1, 1, 3, 3, 3, 0, 2, 2])  # in the order of their groups
    shade = shading(scene, surface)
    assert [(lanes.start, lanes.stop) for lanes, _ in shade.groups] == [(0, 2), (2, 5), (5, 6), (6, 8)]
    lit = shade.lit()
    assert same(lit.surface, surface.take(np.arange(5)))
    assert (lit.wo == shade.wo[:, :5]).all()
    assert [type(bsdf) for _, bsdf in lit.groups] == [wf.Diffuse, wf.Conductor]
    assert len(shading(scene, surface.take(np.arange(5, 8))).lit().surface) == 0
    assert shading(scene, surface.take(np.arange(5))).lit().surface.material.tolist() == [1, 1, 3, 3, 3]


def test_directions_are_local_unless_no_material_reads_them() -> None:
    """Matte materials alone are seen from straight above."""
    surface = record(SurfaceInteraction, 4)
    surface.ns = normalize(surface.ns)
    local = Frame.from_normal(surface.ns).to_local(surface.wo)
    surface.material = np.array([0, 0, 1, 1])
    assert (shading(balls(GREY, GREY), surface).wo == [[0], [0], [1]]).all()
    assert (shading(balls(GREY, GOLD), surface).wo == local).all()
    surface.material = np.zeros(4, np.intp)
    assert (shading(balls(GREY, GOLD), surface).wo == [[0], [0], [1]]).all()


def test_what_is_alike_stays_so() -> None:
    """One number for all columns is gathered without being written down, however many are asked for."""
    paths = record(Paths, 3)
    paths.roulette_scale, paths.throughput = (
        broadcast(f4(2), 3),
        np.broadcast_to(paths.throughput[:, :1], (3, 3)),
    )
    for index in ([1], [0, 1, 2], [2, 2, 1, 0], slice(1, 3)):
        part = paths.take(index if isinstance(index, slice) else np.array(index))
        assert part.roulette_scale.tolist() == [2] * len(part)
        assert (part.throughput == paths.throughput[:, :1]).all()
        assert part.roulette_scale.strides == (0,)
        assert part.slot.tolist() == paths.slot[index].tolist()


def test_absent_fields_stay_absent() -> None:
    surface = record(SurfaceInteraction, 4, absent=("uv",))
    assert len(surface) == 4
    assert surface.take(np.array([2, 2])).uv is None
    assert SurfaceInteraction.concatenate([surface, surface]).uv is None


def carrying(throughput: float, roulette_scale: float, n: int) -> Paths:
    """Paths of n different addresses, all alike."""
    paths = record(Paths, n)
    paths.pixel, paths.sample = np.arange(n, dtype=np.uint32), np.zeros(n, np.uint32)
    paths.throughput, paths.roulette_scale = np.full((3, n), throughput, f4), np.full(n, roulette_scale, f4)
    return paths


def survivors(paths: Paths, bounce: int = ROULETTE_AFTER, branches: int = 1) -> Paths:
    """The paths that roulette leaves."""
    scene: Any = SimpleNamespace(roulette_after=ROULETTE_AFTER, program=Program([Branches(branches)]))
    return paths.take(stage.roulette(scene, paths, make_sampler("independent"), bounce))


@pytest.mark.parametrize("throughput", [0.45, 0.25, 0.05])
def test_roulette_keeps_the_mean(throughput: float) -> None:
    """A weak path survives with twice its throughput as its chance, and then carries more by as much."""
    n = 1 << 16
    left, chance = survivors(carrying(throughput, 1, n)), throughput / float(stage.ROULETTE_THRESHOLD)
    assert len(left) / n == pytest.approx(chance, abs=4 * np.sqrt(chance * (1 - chance) / n))
    assert left.throughput == pytest.approx(throughput / chance, rel=1e-6)


@pytest.mark.parametrize("throughput", [0.5, 1.0, 3.0])
def test_roulette_spares_the_strong(throughput: float) -> None:
    """A path that carries half or more goes on as it is; the bounces are bounded all the same."""
    left = survivors(carrying(throughput, 1, 1 << 12))
    assert len(left) == 1 << 12
    assert left.throughput == pytest.approx(throughput, rel=1e-6)


@pytest.mark.parametrize("branches", [2, 5])
def test_roulette_spares_branches(branches: int) -> None:
    """One of several branches carries less, and that is no reason to end it."""
    n = 1 << 14
    assert len(survivors(carrying(0.5 / branches, 1, n), branches=branches)) == n
    left = survivors(carrying(0.25 / branches, 1, n), branches=branches)
    assert len(left) / n == pytest.approx(0.5, abs=0.02)
    assert left.throughput == pytest.approx(0.5 / branches, rel=1e-6)


def test_roulette_waits() -> None:
    """In the first bounces only paths that carry nothing end."""
    paths = carrying(0.01, 1, 100)
    paths.throughput[:, ::2] = 0
    left = survivors(paths, ROULETTE_AFTER - 1)
    assert left.pixel.tolist() == list(range(1, 100, 2))
    assert left.throughput == pytest.approx(0.01)
    assert len(survivors(paths)) <= 50


def test_roulette_looks_through_refraction() -> None:
    """Radiance that glass has compressed by η² is no reason to end a path."""
    left = survivors(carrying(0.25 / 2.25, 2.25, 1 << 14))  # of 0.25: a chance of a half
    assert len(left) / (1 << 14) == pytest.approx(0.5, abs=0.02)


def test_paths_remember_by_how_much_glass_compresses(calls_of: Any) -> None:
    """η² inside a ball of index 1.5, 1 where they were reflected and after they have left it."""
    seen = []

    def note(scene: CompiledScene, paths: Paths, sampler, bounce: int):
        seen.append(np.unique(paths.roulette_scale.round(4)).tolist())
        return np.arange(len(paths))

    calls_of("wavefront.integrators.steps.roulette", note)
    render(scenes.glass_ball(), 16, max_bounces=2)
    assert seen == [[1, 2.25], [1, 2.25]]


def test_roulette_is_a_setting() -> None:
    """From the first event on, from a later one, or never: the same mean, and other paths."""
    dim = [
        wf.Sphere((0, 0, 0), 1, material=wf.Diffuse(0.3)),
        wf.Rectangle((-3, -1, 3), (6, 0, 0), (0, 0, -6)),
    ]
    scene = [*dim, wf.Environment(1)]
    options = {"size": (16, 16), "reuse": False, "branches": 1, "progress": False}
    always, usual, late, never = (wf.render(scene, 64, roulette=n, **options) for n in (0, 2, 13, False))
    assert late.rgb.tobytes() == never.rgb.tobytes() != usual.rgb.tobytes()
    assert always.rgb.mean() == pytest.approx(never.rgb.mean(), rel=0.02)
    assert always.standard_error.mean() > 1.1 * never.standard_error.mean()
    assert never.metadata["roulette"] is False


def test_a_checkpoint_of_another_roulette_is_refused(tmp_path) -> None:
    scene, options = [wf.Sphere((0, 0, 0), 1), wf.Environment(1)], {"size": (8, 8), "progress": False}
    wf.render(scene, 2, checkpoint=tmp_path / "a.wfck", **options)
    assert wf.render(scene, 4, checkpoint=tmp_path / "a.wfck", roulette=2, **options).spp == 4
    with pytest.raises(wf.SceneError, match="roulette was 2 and is False"):
        wf.render(scene, 8, checkpoint=tmp_path / "a.wfck", roulette=False, **options)
