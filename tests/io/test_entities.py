"""Entities of scene files: parameters by name and type, and what is said of those that did not count."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from inside import Conversion, Entity, SceneError, SceneFiles, Table

TABLE = Table("a format", harmless={"lamp": "watts"})
TABLE.converts("lamp", "bulb", harmless="socket")(lambda entity: entity.number("lumen", 1.0))
TABLE.converts("lamp", "tube", "lumen", holds="gas")(lambda entity: entity.number("lumen", 1.0))
TABLE.unsupported("lamp", "candle")


class Job(Conversion):
    table = TABLE


@pytest.fixture
def job() -> Job:
    return Job("a.txt", SceneFiles("a.txt"), Path, lambda path: [])


def lamp(job: Job, type: str, **values: Any) -> Entity:
    return Entity("lamp", type, "", "line 1", values, job)


def lost(job: Job) -> list[str]:
    return [each.part for each in job.files.losses.found]


def test_what_a_converter_does_not_read_is_named(job: Job) -> None:
    assert job.convert(lamp(job, "bulb", color=1, lumen=2.0, socket=3, watts=4, smell=5)) == 2
    assert lost(job) == ["color", "smell"]


def test_what_a_table_does_not_list_is_named_with_what_it_holds(job: Job) -> None:
    gas, box = Entity("gas", "neon", "", "line 2", {}, job), Entity("box", "", "", "line 3", {}, job)
    assert job.convert(lamp(job, "tube", lumen=2.0, inside=gas, cover=box, color=1)) == 2
    assert lost(job) == ["box 'cover'", "color"]


def test_what_a_table_does_not_list_cannot_be_read(job: Job) -> None:
    with pytest.raises(KeyError, match="tube does not read color"):
        lamp(job, "tube", color=1).get("color")


def test_unknown_types_have_a_suggestion(job: Job) -> None:
    assert job.convert(lamp(job, "blub")) is None
    assert lost(job) == ["a format has no such lamp; did you mean 'bulb'?"]


def test_types_that_are_not_supported_are_named(job: Job) -> None:
    assert job.convert(lamp(job, "candle", lumen=1)) is None
    assert lost(job) == ["left out"]


def test_declared_types_are_checked_and_lists_give_their_first_value(job: Job) -> None:
    entity = lamp(job, "bulb", lumen=np.array([2.0, 3.0]), at=np.eye(3), lit=[True], name=["x"], empty=[])
    entity.types = {"lumen": "float", "at": "point3", "lit": "bool", "name": "string", "empty": "string"}
    assert (entity.number("lumen", 1.0), entity.flag("lit"), entity.text("name", "")) == (2.0, True, "x")
    assert entity.vector("at", (0, 0, 0)).tolist() == [1, 0, 0]
    assert entity.unread == {"empty"}
    with pytest.raises(SceneError, match="lumen is a float; it must be a rgb or spectrum"):
        entity.get("lumen", None, "rgb", "spectrum")
    with pytest.raises(SceneError, match="empty has no value"):
        entity.get("empty", None, "string")


@pytest.mark.parametrize(
    ("given", "value", "unread"),
    [({"old": 1}, 1, {"new"}), ({"old": 1, "new": 2}, 2, {"new"}), ({"new": 2}, 2, {"new"})],
)
def test_parameters_of_older_versions_get_their_new_names(
    job: Job, given: dict[str, int], value: int, unread: set[str]
) -> None:
    entity = lamp(job, "bulb", **given)
    entity.types = dict.fromkeys(given, "integer")
    entity.rename("old", "new")
    assert (entity.values, entity.types, entity.unread) == ({"new": value}, {"new": "integer"}, unread)


def test_messages_show_an_entity_in_short(job: Job) -> None:
    assert repr(lamp(job, "bulb", lumen=1)) == "<lamp 'bulb'>"
