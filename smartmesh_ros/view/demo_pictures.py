"""Pictures of the demo as the view shows it."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from smartmesh_ros.client.messages import read_patches
from smartmesh_ros.node.demo_pictures import Snapshot
from smartmesh_ros.view import reading
from smartmesh_ros.view.browser import find_browser
from smartmesh_ros.view.ground import Ground
from smartmesh_ros.view.looks import PatchLook, patch_look
from smartmesh_ros.view.sight import Sight
from smartmesh_ros.view.studio import Camera, Studio, places_in

# Pixels of the picture and of a frame of the clip, and the frames that the strip and the clip have at most.
PICTURE, SMALL = (1280, 640), (640, 360)
STRIP, CLIP = 6, 24
# The picture is of a time when bodies are on the ground and still near each other [s].
BEST_TIMES = (2.5, 7.0)
# Where pictures are taken from: behind the robot, seen from the other bodies, and above it; and the point ahead of it
# that they show in the middle [m].
BEHIND, ABOVE, AHEAD, LEAST = 5.5, 3.8, 3.2, 2.4
FIELD_OF_VIEW = math.radians(42.0)


def draw_in_browser(snapshots: list[Snapshot], folder: Path) -> list[Path]:
    """Writes a picture, a strip of six frames and a clip; returns their paths, none where there is no browser."""
    path = find_browser()
    if path is None:
        return []
    folder.mkdir(parents=True, exist_ok=True)
    picture, strip, clip = (folder / name for name in ("demo.png", "demo_frames.png", "demo.gif"))
    try:
        with Studio(path, PICTURE) as studio:
            ground, sight = scene_of(best_of(snapshots))
            with_legend(studio.shoot(ground, sight, camera_of(ground, sight)), sight).save(picture, optimize=True)
        with Studio(path, SMALL) as studio:
            frames = [frame(studio, snapshots[index]) for index in spread(len(snapshots), CLIP)]
    except TimeoutError:
        return []
    save_strip([frames[index] for index in spread(len(frames), STRIP)], strip)
    frames[0].save(clip, save_all=True, append_images=frames[1:], duration=200, loop=0)
    return [picture, strip, clip]


def best_of(snapshots: list[Snapshot]) -> Snapshot:
    """The snapshot at a good time that shows the most bodies and kinds of patches, none of them cut off."""
    in_time = [snapshot for snapshot in snapshots if BEST_TIMES[0] <= snapshot.time <= BEST_TIMES[1]]
    return max(in_time or snapshots, key=_worth)


def _worth(snapshot: Snapshot) -> float:
    ground, sight = scene_of(snapshot)
    positions = np.array([pose.position for pose in sight.poses.values()])
    away = np.abs(places_in(camera_of(ground, sight), positions, PICTURE[0] / PICTURE[1])).max(axis=1)
    whole, cut = (away < 0.85).sum(), ((away >= 0.85) & (away < 1.15)).sum()
    kinds = {patch_look(patch.kind, patch.stride) for patch in sight.patches}
    return float(whole - 2 * cut + 2 * len(kinds))


def scene_of(snapshot: Snapshot) -> tuple[Ground, Sight]:
    """The terrain and all that moves of a snapshot."""
    ground, sight = Ground(), Sight()
    ground.take_map(snapshot.messages["heightmap"])
    ground.settle()
    for topic in reading.KINDS:
        if topic in snapshot.messages:
            reading.take(sight, topic, snapshot.messages[topic])
    sight.patches = read_patches(snapshot.messages["collider_patches"]).patches
    return ground, sight


def camera_of(ground: Ground, sight: Sight) -> Camera:
    """Over the robot's shoulder to the middle of the other bodies."""
    robot = np.array(next(iter(sight.bases.values())).position)
    others = np.median([pose.position for pose in sight.poses.values()], axis=0)
    towards = (others - robot)[:2] / max(float(np.linalg.norm((others - robot)[:2])), 1e-9)
    position = robot + (*(-BEHIND * towards), ABOVE)
    below = float(ground.heights(position[None, :2])[0])
    position[2] = max(position[2], below + LEAST)
    x, y, z = (robot + (*(AHEAD * towards), 0.0)).tolist()
    return Camera((float(position[0]), float(position[1]), float(position[2])), (x, y, z), FIELD_OF_VIEW)


def frame(studio: Studio, snapshot: Snapshot) -> Image.Image:
    """A frame of the clip."""
    ground, sight = scene_of(snapshot)
    return Image.fromarray(studio.shoot(ground, sight, camera_of(ground, sight)))


def with_legend(picture: NDArray[np.uint8], sight: Sight) -> Image.Image:
    """The picture with the colours of the patches that are in it."""
    image = Image.fromarray(picture)
    pen, font = ImageDraw.Draw(image), ImageFont.load_default(size=19)
    there = {patch_look(patch.kind, patch.stride) for patch in sight.patches}
    shown = [look for look in PatchLook if look in there]
    pen.rounded_rectangle((12, 12, 300, 24 + 30 * len(shown)), radius=6, fill=(255, 255, 255))
    for line, look in enumerate(shown):
        top = 22 + 30 * line
        pen.rectangle((24, top, 44, top + 20), fill=look.colour)
        pen.text((54, top - 1), look.words, fill=(40, 40, 40), font=font)
    return image


def save_strip(frames: list[Image.Image], path: Path) -> None:
    """Frames in two rows, in the order of time."""
    width, height = frames[0].size
    columns = -(-len(frames) // 2)
    strip = Image.new("RGB", (columns * width, 2 * height), "white")
    for index, one in enumerate(frames):
        strip.paste(one, (index % columns * width, index // columns * height))
    strip.save(path, optimize=True)


def spread(count: int, most: int) -> list[int]:
    """At most so many of ``count`` indices, evenly spread, the first and the last among them."""
    return [int(index) for index in np.unique(np.linspace(0, count - 1, min(count, most)).round())]
