"""The soil of the settings, as the ground that bodies stand on."""

from __future__ import annotations

from smartmesh_ros.node.parameters.settings import Settings
from smartmesh_ros.soil.config import soils_from
from smartmesh_ros.soil.soil import Soil
from smartmesh_ros.terrain.heightmap import HeightMap
from smartmesh_ros.world.world import World


def stand_on_soil(world: World, settings: Settings) -> None:
    """Let bodies stand on the soil of the settings if the first tile is a height map, else on the map itself. The soil
    of a tile keeps its prints."""
    tile, known = world.terrain.tiles.get(""), world.ground.soil
    if not settings.soil or not isinstance(tile, HeightMap):
        if known is not None:
            world.ground.set_soil(None)
    elif isinstance(known, Soil) and known.map is tile and known.soils == soils_from(settings.soil):
        known.slip_sinkage = settings.slip_sinkage
    else:
        world.ground.set_soil(Soil(world.terrain, settings.soil, slip_sinkage=settings.slip_sinkage))
