"""``make renders``: the README's moving picture. The same bodies on a height field that is replaced at each map, and on
``smartmesh_ros``; how deep the deepest body is below the true ground is measured and written on it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pybullet as pb
from PIL import Image, ImageDraw, ImageFont

from smartmesh_ros.terrain.grid import FloatArray
from studies.progress import Progress
from studies.rising import FRAMES, HALF, SHOWN, WAYS, height, simulated
from studies.tiny_renderer import Camera, Stage

SAND, CUT = (0.80, 0.72, 0.58), (0.45, 0.36, 0.28)
BLUE, PLUM = (0.20, 0.42, 0.80), (0.75, 0.30, 0.50)
CAMERA = Camera((0.0, -13.0, 3.2), (0.0, 0.0, 0.12), 10.8, 800, 224)
DEEP, RED = 0.005, (190, 30, 30)  # depths above this [m] are written in red
OUT = Path("docs/images/rising.gif")


def surfaces(time: float) -> tuple[tuple[FloatArray, Any], ...]:
    """Return the ground behind the bodies' middles, and the cut through it there."""
    x = np.linspace(-4.1, 4.1, 165)
    top = height(x, time)
    behind = np.stack([np.stack([x, np.full_like(x, y), top], axis=1) for y in (0.0, 1.0, 2.0)])
    cut = np.stack([np.stack([x, np.zeros_like(x), z], axis=1) for z in (np.full_like(x, -0.75), top)])
    return (behind, SAND), (cut, CUT)


def label(strip: Image.Image, way: str, depth: float) -> None:
    """Write on a picture what carries the bodies, and how deep [m] the deepest of them is."""
    write, font = ImageDraw.Draw(strip), ImageFont.load_default(size=19)
    write.text((12, 4), way, "black", font)
    words = f"deepest body: {1e3 * depth:.0f} mm below ground"
    write.text((CAMERA.width - 12, 4), words, RED if depth > DEEP else "black", font, anchor="ra")


def main() -> None:
    """Run both simulations, and write the pictures."""
    say, stage = Progress(), Stage()
    drawn = [
        stage.add(pb.GEOM_BOX, PLUM, halfExtents=[HALF] * 3) if box else stage.add(pb.GEOM_SPHERE, BLUE, radius=HALF)
        for box in (False, True, False, True, False)
    ]
    deepest = dict.fromkeys(WAYS, 0.0)
    pictures = []
    for both in zip(*map(simulated, WAYS), strict=True):
        picture = Image.new("RGB", (CAMERA.width, len(WAYS) * CAMERA.height), "white")
        for row, (way, (time, poses, depths)) in enumerate(zip(WAYS, both, strict=True)):
            stage.replace_ground(*surfaces(time))
            for body, pose in zip(drawn, poses, strict=True):
                stage.client.resetBasePositionAndOrientation(body, *pose)
            strip = Image.fromarray(stage.shoot(CAMERA).colours)
            label(strip, way, float(depths.max()))
            picture.paste(strip, (0, row * CAMERA.height))
            deepest[way] = max(deepest[way], float(depths.max()))
        pictures.append(picture.quantize(64, dither=Image.Dither.NONE))
        say(f"{len(pictures)} pictures of {round(FRAMES * SHOWN)}")
    stage.close()
    pictures[0].save(OUT, save_all=True, append_images=pictures[1:], duration=50, loop=0, optimize=True)
    for way, most in deepest.items():
        print(f"\n{way}: at most {1e3 * most:.1f} mm below the ground", end="")
    print(f"\nwrote {OUT}, {OUT.stat().st_size / 1e6:.1f} MB")


if __name__ == "__main__":
    main()
