"""One collider of the whole main mesh (Simple-Mesh, Table 1), in today's engines."""

from __future__ import annotations

from typing import Any

from smartmesh_ros.errors import InputError
from smartmesh_ros.terrain.trimesh import grid_triangles
from studies.bench.measure import Bench, Case
from studies.bench.moving import FRAME, RESOLUTION, Waves, doubles, grid_vertices
from studies.bench.report import LARGER, SIMPLE_PHYSX
from studies.engines.engine import Setup, build, missing

ENGINES = ("physx", "bullet_trimesh", "bullet_heightfield", "mujoco")


def sides(quick: bool) -> tuple[int, ...]:
    """Sizes to measure, ascending."""
    return (3, 5, 25, 50) if quick else (*SIMPLE_PHYSX, *LARGER)


def measure_engine(bench: Bench, name: str) -> None:
    """Measure updates of the whole collider in one engine, up to the size at which a frame takes too long."""
    if missing(name):
        bench.results.left_out[name] = missing(name)
        return
    before = 0
    for side in sides(bench.effort.quick):
        case = Case("simple", name, side)
        if before and bench.hopeless(case, before):
            return
        try:
            _measure_update(bench, case)
        except InputError as error:  # larger than the engine takes
            bench.results.left_out[f"{name} {side}x{side}"] = str(error)
            return
        before = side


def _measure_update(bench: Bench, case: Case) -> None:
    waves = Waves(case.side)
    setup = Setup(heights=doubles(waves.now), resolution=RESOLUTION, bodies=(), dt=FRAME)
    with build(case.method, setup) as engine:
        maps = waves.converted(engine.ready)
        in_report = case.method in ("physx", "bullet_trimesh") and case.side in SIMPLE_PHYSX
        seconds = bench.effort.report_seconds if in_report else None
        bench.time(case, lambda: engine.set_ground(maps.now), maps.next, seconds)


def measure_trees(bench: Bench) -> None:
    """Bounding volume hierarchies alone, with coal: rebuilt, refitted, and the heights of a height field replaced."""
    try:
        import coal
    except ImportError as error:
        bench.results.left_out["coal"] = str(error)
        return
    before = 0
    for side in sides(bench.effort.quick):
        waves = Waves(side)
        _measure_bvh(bench, coal, waves, before)
        field = Case("simple", "coal_heightfield", side)
        if before and bench.hopeless(field, before):
            return
        _measure_field(bench, coal, waves, field)
        before = side


def _measure_field(bench: Bench, coal: Any, waves: Waves, case: Case) -> None:
    frames = waves.converted(doubles)
    extent = (waves.side - 1) * RESOLUTION
    field = coal.HeightFieldOBBRSS(extent, extent, frames.now, -10.0)
    bench.time(case, lambda: field.updateHeights(frames.now), frames.next)


def _measure_bvh(bench: Bench, coal: Any, waves: Waves, before: int) -> None:
    rebuild, refit = (Case("simple", method, waves.side) for method in ("coal_rebuild", "coal_refit"))
    if before and bench.hopeless(refit, before):
        return
    triangles = grid_triangles(waves.side, waves.side)
    vertices = grid_vertices(waves.next())

    def built() -> Any:
        model = coal.BVHModelOBBRSS()
        model.beginModel(len(triangles), len(vertices))
        model.addVertices(vertices)
        model.addTriangles(triangles)
        model.endModel()
        return model

    if not before or not bench.hopeless(rebuild, before):
        bench.time(rebuild, built)
    model = built()
    # Two frames in coal's own kind of list, because making one takes longer than the refit.
    frames = []
    for _ in range(2):
        frame = coal.StdVec_Vec3s()
        frame.extend(list(grid_vertices(waves.next())))
        frames.append(frame)

    def refitted() -> None:
        frames.reverse()
        model.beginReplaceModel()
        model.replaceSubModel(frames[0])
        model.endReplaceModel(True, True)

    bench.time(refit, refitted)
