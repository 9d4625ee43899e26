"""Other packages add to the tables by entry points."""

import sys
from importlib.metadata import entry_points

import numpy as np
import pytest
from inside import Registry

import wavefront as wf

CODE = """
import numpy as np

def middle(u):
    return np.full_like(u, 0.5)

class Number:
    pass

broken = 3
"""


@pytest.fixture
def plugged(tmp_path, monkeypatch):
    """A package that is installed, with entry points."""
    (tmp_path / "some_plugin.py").write_text(CODE)
    info = tmp_path / "some_plugin-1.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: some-plugin\nVersion: 1\n")
    (info / "entry_points.txt").write_text(
        "[wavefront.kind]\nmiddle = some_plugin:middle\n"
        "absent = no_such_module:thing\nwrong = some_plugin:broken\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    yield
    sys.modules.pop("some_plugin", None)


@pytest.mark.usefixtures("plugged")
def test_a_name_of_an_entry_point_is_known() -> None:
    table = Registry("kind", "a function", {"own": np.abs})
    assert "some_plugin" not in sys.modules
    assert table.find("middle")(np.zeros(3)).tolist() == [0.5] * 3
    assert "middle" in table
    assert "other" not in table
    with pytest.raises(
        wf.SceneError, match=r"kind is 'midle'; it must be one of own, .*did you mean 'middle'"
    ):
        table.find("midle")


@pytest.mark.usefixtures("plugged")
@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("absent", "of no_such_module:thing cannot be loaded: No module"),
        ("wrong", "is 3; it must be a function"),
    ],
)
def test_what_cannot_be_used_is_named(name: str, message: str) -> None:
    with pytest.raises(wf.SceneError, match=message):
        Registry("kind", "a function", {}).find(name)


def test_each_table_has_a_group_of_its_own() -> None:
    from wavefront.accel.registry import ACCELERATORS
    from wavefront.codecs.images import IMAGE_READERS, IMAGE_WRITERS
    from wavefront.denoising.denoisers import DENOISERS
    from wavefront.integrators.registry import INTEGRATORS
    from wavefront.io.readers import READERS
    from wavefront.lights.samplers import LIGHT_SAMPLERS
    from wavefront.sampling.filters import FILTERS
    from wavefront.sampling.sampler import SAMPLERS
    from wavefront.workers.executors import EXECUTORS

    tables = [
        *(
            ACCELERATORS,
            IMAGE_READERS,
            IMAGE_WRITERS,
            DENOISERS,
            INTEGRATORS,
            READERS,
            LIGHT_SAMPLERS,
            FILTERS,
        ),
        *(SAMPLERS, EXECUTORS),
    ]
    groups = [table.group for table in tables]
    assert len(set(groups)) == len(tables)
    assert "wavefront.sampler" in groups
    assert not entry_points(group="wavefront.no such group")
