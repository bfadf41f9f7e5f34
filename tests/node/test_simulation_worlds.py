"""Worlds of the standard services of simulation_interfaces."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import yaml
from geometry_msgs.msg import Twist, Vector3
from simulation_interfaces import msg, srv
from simulation_interfaces.msg import Resource, Result, SimulationState, TagsFilter

from smartmesh_ros.node.services import simulation_services
from smartmesh_ros.tools.replay.replay import Replay
from smartmesh_ros.tools.testing import heightmap_message
from tests.node.shared import fed
from tests.node.test_simulation_services import OK, ROVER, ask, done, entities, placed, pose_of, set_state, state
from tests.urdfs import link, mesh, robot

L = srv.LoadWorld.Response
BALL = "{id: ball, shape: sphere, size: [0.2], mass: 1.0, xy: [2.0, 1.0], above: 0.5}"
SLOPE = 0.1 * np.arange(20.0)[None, :] + np.zeros((20, 1))  # 0.1 m more in each column
GROUND = heightmap_message(np.zeros((50, 50)))


@pytest.fixture
def worlds(tmp_path: Path) -> Path:
    """A folder of worlds: a slope, and the same with a ball and a robot."""
    folder = tmp_path / "worlds"
    folder.mkdir()
    np.save(folder / "slope.npy", SLOPE)
    (folder / "rover.urdf").write_text(ROVER.read_text())
    rover = "{id: rover, urdf: rover.urdf, xy: [3.0, 1.0]}"
    parameters = {"terrain.file": "slope.npy", "raster": {"resolution": 0.5}, "bodies.spawn": [BALL, rover]}
    scene(folder / "scene.yaml", **parameters, **{"physics.rate": 120.0})
    (folder / "other.yaml").write_text("{a: [1, 2]}")
    return folder


def scene(path: Path, **parameters: Any) -> None:
    path.write_text(yaml.safe_dump({"/**": {"ros__parameters": parameters}}))


@contextmanager
def run_with(folder: Path, *, without: tuple[str, ...] = (), later: tuple[str, ...] = ()) -> Iterator[Replay]:
    """A collider that may read in a folder, with definitions other than those of Jazzy (1.5): ``without`` those whose
    names contain one of some words, and with those of 2.1 for ``later`` names, which the tests' package has as Name2.
    Its first map is yet to come."""
    found = {}
    for kind, module in (("msg", msg), ("srv", srv)):
        names = {name: made for name, made in vars(module).items() if not any(word in name for word in without)}
        names |= {name: names[f"{name}2"] for name in later if f"{name}2" in names}
        found[kind] = SimpleNamespace(**names)
    parameters = {
        "simulation_interfaces": True, "frame_id": "map", "raster.resolution": 0.25,
        "bodies.urdf_folders": [str(folder)],
    }  # fmt: skip
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(simulation_services, "find_interfaces", lambda _, kind: found.get(kind))
        with Replay([("heightmap", 0.0, GROUND)], parameters) as run:
            yield run


@pytest.fixture
def run(worlds: Path) -> Iterator[Replay]:
    with run_with(worlds) as made:
        yield made


def begin(run: Replay, service: str, **fields: Any) -> list[Any]:
    """Calls a service; returns a list that gets its response."""
    served = run.node.services[run.names.full(service)]
    return served.call(served.kind.Request(**fields))


def height(run: Replay, x: float) -> float:
    """Height of the ground at (x, 1) [m]."""
    answer = ask(run, "query_ground", x=[x], y=[1.0])
    assert answer.success, answer.message
    return float(answer.z[0])


def test_a_world_takes_the_place_of_another(run: Replay, worlds: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    s, none = SimulationState, srv.GetCurrentWorld.Response.NO_WORLD_LOADED
    assert ask(run, "get_current_world").result.result == none
    assert ask(run, "unload_world").result.result == none
    run.run(0.0)
    assert ask(run, "get_current_world").world.name == "topics"
    available = done(run, "get_available_worlds").worlds
    assert [world.name for world in available] == ["scene", "slope"]
    done(run, "spawn_entity", uri=str(worlds / "rover.urdf"), name="old", initial_pose=placed(1.0, 1.0, 1.0))

    answer = done(run, "load_world", uri=available[0].world_resource.uri)
    assert (answer.world.name, answer.result.error_message, state(run)) == ("scene", "", s.STATE_STOPPED)
    assert ask(run, "get_current_world").world == answer.world
    assert set(entities(run)) == {"ball", "rover"}
    assert pose_of(run, "ball") == pytest.approx((2.0, 1.0, 0.4 + 0.5), abs=1e-6), "cells of 0.5 m, by its file"
    starts = {pose.name: pose.pose.position for pose in ask(run, "get_named_poses").poses}
    assert starts.keys() == {"ball", "rover"}
    assert (starts["rover"].x, starts["rover"].y, starts["rover"].z) == pytest.approx(pose_of(run, "rover"))
    assert ask(run, "get_named_poses", tags=TagsFilter(tags=["parking"])).poses == []
    assert height(run, 4.0) == pytest.approx(0.8, abs=1e-6)

    run.world.step(12)
    run.world.remove("rover")
    assert ask(run, "start_episode", seed=4).success and (run.world.time, run.world.seed) == (0.0, 4)
    assert set(entities(run)) == {"ball", "rover"}
    assert height(run, 4.0) == pytest.approx(0.8, abs=1e-6), "an episode begins with the new world"

    monkeypatch.setenv("HOME", str(worlds))
    scene(worlds / "home.yaml", **{"terrain.file": "~/slope.npy"})
    for name in ("slope.npy", "home.yaml"):
        assert ask(run, "load_world", uri=f"file://{worlds}/{name}").world.name == name.partition(".")[0]
        assert (entities(run), state(run)) == ([], s.STATE_STOPPED)
        assert height(run, 4.0) == pytest.approx(1.6, abs=1e-6), "cells of 0.25 m, by the parameter"

    done(run, "unload_world")
    assert ask(run, "get_current_world").result.result == none
    assert state(run) == s.STATE_NO_WORLD
    r = srv.SetSimulationState.Response
    assert set_state(run, s.STATE_PLAYING) == r.INCORRECT_TRANSITION
    assert set_state(run, s.STATE_NO_WORLD) == r.ALREADY_IN_TARGET_STATE
    assert ask(run, "step_simulation", steps=1).result.result == Result.RESULT_OPERATION_FAILED
    run.give("heightmap", GROUND)
    assert state(run) == s.STATE_STOPPED
    assert set_state(run, s.STATE_PLAYING) == OK


def test_a_world_that_is_refused_changes_nothing(run: Replay, worlds: Path) -> None:
    scene(worlds / "no_terrain.yaml", **{"terrain.file": "no_such.npy", "bodies.spawn": [BALL]})
    scene(worlds / "no_mesh.yaml", **{"bodies.spawn": ["{id: a, urdf: bad.urdf, xyz: [0, 0, 1]}", BALL]})
    (worlds / "bad.urdf").write_text("<robot")
    scene(worlds / "no_file.yaml", **{"bodies.spawn": ["{id: a, urdf: bare.urdf, xyz: [0, 0, 1]}", BALL]})
    (worlds / "bare.urdf").write_text(robot(link("l", mesh("no_such.stl"), None)))
    scene(worlds / "type.yaml", **{"terrain.file": "slope.npy", "raster.resolution": "fine"})
    bomb = "".join(f"  a{k}: &a{k} {{l: *a{k - 1}, r: *a{k - 1}}}\n" for k in range(1, 40))
    (worlds / "alias.yaml").write_text(f"ros__parameters:\n  a0: &a0 {{x: 1}}\n{bomb}")
    (worlds / "flat.npy").write_bytes((worlds / "slope.npy").read_bytes()[:-8])
    done(run, "load_world", uri=str(worlds / "scene.yaml"))
    before = ask(run, "get_current_world").world
    for code, fields in (
        (L.NO_RESOURCE, {}),
        *((L.UNSUPPORTED_FORMAT, {"uri": path}) for path in (f"{worlds}/rover.urdf", "/nowhere/world.sdf")),
        (Result.RESULT_OPERATION_FAILED, {"uri": f"{worlds}/../../slope.npy"}),
        (Result.RESULT_OPERATION_FAILED, {"uri": "http://host/slope.npy"}),
        (L.RESOURCE_PARSE_ERROR, {"uri": "package://no_such_pkg/slope.npy"}),
        (L.RESOURCE_PARSE_ERROR, {"uri": f"file://{worlds}/no_such.yaml"}),
        (L.RESOURCE_PARSE_ERROR, {"uri": f"file://{worlds}/{'long' * 999}.npy"}),
        *((L.RESOURCE_PARSE_ERROR, {"uri": f"{worlds}/{name}.npy"}) for name in ("no_such", "flat")),
        *((L.RESOURCE_PARSE_ERROR, {"uri": f"{worlds}/{name}.yaml"}) for name in ("other", "type", "alias")),
        (L.MISSING_ASSETS, {"uri": f"{worlds}/no_terrain.yaml"}),
        (L.MISSING_ASSETS, {"uri": f"{worlds}/no_file.yaml"}),
        (L.UNSUPPORTED_ASSETS, {"uri": f"{worlds}/no_mesh.yaml"}),
        (L.UNSUPPORTED_ELEMENTS, {"uri": f"{worlds}/scene.yaml", "fail_on_unsupported_element": True}),
        *((L.RESOURCE_PARSE_ERROR, {"resource_string": text}) for text in ("{", "<sdf/>", "[" * 5000, "!!bool x")),
    ):
        result = ask(run, "load_world", **fields).result
        assert (result.result, bool(result.error_message)) == (code, True), (fields, result.error_message)
        assert "send the text" not in result.error_message, "a terrain file has none"
    assert ask(run, "get_current_world").world == before
    assert set(entities(run)) == {"ball", "rover"}
    assert height(run, 4.0) == pytest.approx(0.8, abs=1e-6)

    text = (worlds / "no_mesh.yaml").read_text().replace("bad.urdf", "package://no_such_pkg/a.urdf")
    answer = done(run, "load_world", resource_string=text, ignore_missing_or_unsupported_assets=True)
    assert all(words in answer.result.error_message for words in ("no_such_pkg", "ball")), "what is left out, and waits"
    assert answer.world.world_resource.resource_string == text
    assert entities(run) == []
    run.give("heightmap", GROUND)
    assert entities(run) == ["ball"]


def test_what_is_there_is_listed(run: Replay, worlds: Path) -> None:
    [rover] = ask(run, "get_spawnables").spawnables
    assert (rover.uri, rover.description) == ((worlds / "rover.urdf").as_uri(), "rover")
    done(run, "spawn_entity", uri=rover.uri, initial_pose=placed(1.0, 1.0, 1.0))
    elsewhere = done(run, "get_spawnables", sources=[str(worlds), "/etc", "http://host"])
    assert len(elsewhere.spawnables) == 1
    assert all(source in elsewhere.result.error_message for source in ("/etc", "http://host"))
    assert "send the text" not in elsewhere.result.error_message, "a folder has none"
    r, gone = srv.GetAvailableWorlds.Response, [str(worlds / "gone"), str(worlds)]
    for code, count, fields in (
        (OK, 2, {"additional_sources": [worlds.as_uri()], "offline_only": True}),
        (Result.RESULT_NOT_FOUND, 0, {"additional_sources": ["/etc"]}),
        (OK, 2, {"additional_sources": ["/etc"], "continue_on_error": True}),
        (Result.RESULT_FEATURE_UNSUPPORTED, 0, {"filter": TagsFilter(tags=["indoor"])}),
    ):
        answer = ask(run, "get_available_worlds", **fields)
        assert (answer.result.result, len(answer.worlds)) == (code, count), fields
    run.set(bodies__urdf_folders=gone)
    assert ask(run, "get_available_worlds").result.result == r.DEFAULT_SOURCES_FAILED
    assert len(ask(run, "get_available_worlds", continue_on_error=True).worlds) == 2


def test_one_world_is_loaded_at_a_time(run: Replay, worlds: Path) -> None:
    answers = begin(run, "load_world", uri=f"{worlds}/scene.yaml")
    [now] = begin(run, "get_simulation_state")
    assert now.state.state == SimulationState.STATE_LOADING_WORLD
    [refused] = begin(run, "set_simulation_state", state=SimulationState(state=SimulationState.STATE_PLAYING))
    assert refused.result.result == srv.SetSimulationState.Response.INCORRECT_TRANSITION
    for service, fields in (("load_world", {"uri": f"{worlds}/slope.npy"}), ("unload_world", {})):
        [refused] = begin(run, service, **fields)
        assert refused.result.result == Result.RESULT_INCORRECT_STATE
    assert not answers
    assert ask(run, "get_simulation_state").state.state == SimulationState.STATE_LOADING_WORLD
    assert answers[0].world.name == "scene"


def test_a_robot_on_its_way_onto_the_ground_is_no_part_of_another_scene() -> None:
    with fed({"bodies.spawn": [f"{{id: rover, urdf: {ROVER}, xy: [1, 1]}}"]}) as node:
        node.give("heightmap", GROUND, steps=0)
        assert any(node.node.initial.waiting.values())
        node.node.set_scene(None, {})
        node.give("heightmap", GROUND, steps=0)
        while node.node.turn():
            pass
        assert not any(node.node.initial.waiting.values())
        assert not node.world.bodies


def test_the_definitions_of_2_are_served(worlds: Path) -> None:
    changes = ("SpawnEntity", "SetEntityState", "LoadWorld", "GetSpawnables", "Spawnable")
    with run_with(worlds, later=changes) as run:
        [spawnable] = ask(run, "get_spawnables").spawnables
        resource = Resource(uri=(worlds / "scene.yaml").as_uri())
        assert ask(run, "load_world", world_resource=resource).world.world_resource == resource
        given = {"entity_resource": spawnable.entity_resource, "initial_pose": placed(1.0, 2.0, 9.0)}
        assert ask(run, "spawn_entity", name="a", **given).entity_name == "a"
        moved = msg.EntityState(pose=placed(0.0, 0.0, 5.0).pose, twist=Twist(linear=Vector3(x=1.5)))
        assert ask(run, "set_entity_state", entity="a", state=moved, set_twist=True).result.result == OK
        found = ask(run, "get_entity_state", entity="a").state
        assert (found.pose.position.z, found.twist.linear.x) == pytest.approx((9.0, 1.5), abs=1e-6)
        features = ask(run, "get_simulator_features").features
        assert features.STEP_SIMULATION_ACTION not in features.features, "this package has no action"
        assert features.WORLD_LOADING in features.features


def test_the_definitions_of_1_0_are_served(tmp_path: Path) -> None:
    """They have neither worlds nor SpawnEntities."""
    with run_with(tmp_path, without=("World", "SpawnEntities", "Resource")) as run:
        features = ask(run, "get_simulator_features").features
        assert {features.WORLD_LOADING, features.SPAWNING_ENTITIES} & set(features.features) == set()
        assert features.NAMED_POSES in features.features
        assert ask(run, "get_named_poses").result.result == OK
