"""The soil of the parameter ``soil.type``, under the bodies of a collider."""

from __future__ import annotations

from smartmesh_ros.errors import InputError
from smartmesh_ros.node.parameters.settings import Settings
from smartmesh_ros.soil.contact_soil import ContactSoil
from smartmesh_ros.soil.soils import soil_named
from smartmesh_ros.terrain.heightmap import HeightMap
from smartmesh_ros.world.world import World


def require_soil(world: World, settings: Settings) -> None:
    """Raise `InputError` if the settings ask for soil, and contacts cannot come from the map."""
    if settings.soil and world.ground.no_proxies:
        raise InputError("parameter", f"soil.type needs contacts from the map: {world.ground.no_proxies}")


def stand_on_soil(world: World, settings: Settings) -> None:
    """Let bodies stand on the soil of the settings if the first tile is a height map, else on the map itself. The soil
    of a tile keeps its prints."""
    tile, known = world.terrain.tiles.get(""), world.ground.soil
    if not settings.soil or not isinstance(tile, HeightMap):
        if known is not None:
            world.ground.set_soil(None)
    elif not (isinstance(known, ContactSoil) and known.map is tile and known.soils == [soil_named(settings.soil)]):
        world.ground.set_soil(ContactSoil(world.terrain, settings.soil))
