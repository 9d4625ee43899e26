"""Programs: which features scenes have, in which order they act, and how programs are sent."""

import pickle

import numpy as np
import pytest
from inside import Backdrop, Background, CompiledScene, Feature, Program, compile_scene, make_accelerator

import wavefront as wf

BALL = wf.Sphere((0, 0, 0), 1)


def compiled(scene: wf.Scene, **asked) -> CompiledScene:
    """The scene, with what a session asks for."""
    return compile_scene(scene, lambda geometry: make_accelerator(geometry, "numpy"), asked=asked)


def kinds(program: Program) -> list[type[Feature]]:
    return [type(each) for each in program.features]


def test_a_plain_scene_has_no_features() -> None:
    program = compiled(wf.Scene([BALL], [wf.Environment(1.0)])).program
    assert program.features == ()
    assert (program.leg(0).fly, program.leg(0).meet) == ((), ())


def test_features_that_only_the_camera_meets() -> None:
    sky = wf.Environment(1.0, backdrop=0.5)
    program = compiled(wf.Scene([BALL], [sky])).program
    assert kinds(program) == [Backdrop]
    assert len(program.leg(0).meet) == 1
    assert not program.leg(1).meet
    assert kinds(program.of_sensors()) == []


def test_a_background_hides_the_backdrop() -> None:
    sky, white = wf.Environment(1.0, backdrop=0.5), np.ones((3, 1), np.float32)
    assert kinds(compiled(wf.Scene([BALL], [sky]), background=white).program) == [Background]


@pytest.mark.parametrize("bounce", [0, 1])
def test_programs_are_sent_to_processes(bounce: int) -> None:
    white = np.ones((3, 1), np.float32)
    program = pickle.loads(pickle.dumps(compiled(wf.Scene([BALL]), background=white).program))
    assert len(program.leg(bounce).meet) == 1 - bounce
