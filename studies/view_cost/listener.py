"""A page without a browser: takes what the view sends, and counts how often bodies move.

python -m studies.view_cost.listener URL PROTOCOL SECONDS
"""

from __future__ import annotations

import json
import sys
from time import monotonic

import msgspec
import numpy as np
import zstandard
from websockets.sync.client import connect
from websockets.typing import Subprotocol

# The first message replays the page's controls.
SETTLE = 2.0
# What a page says first of all: where it looks from.
CAMERA = {
    "type": "ViewerCameraMessage", "wxyz": [1.0, 0.0, 0.0, 0.0], "position": [3.0, 3.0, 3.0], "fov": 1.0,
    "near": 0.1, "far": 1000.0, "image_height": 800, "image_width": 1280, "look_at": [0.0, 0.0, 0.0],
    "up_direction": [0.0, 0.0, 1.0],
}  # fmt: skip
# What a message is called that moves bodies, and one that brings the ground's heights.
MOVES, GROUND = b"batched_positions", b"/terrain/"


def main() -> None:
    """Prints updates of bodies and of the ground a second, the longest time without the former [s], and MB/s."""
    url, protocol, seconds = sys.argv[1], sys.argv[2], float(sys.argv[3])
    moves: list[float] = []
    grounds, size = 0, 0
    with connect(url, subprotocols=[Subprotocol(protocol)], max_size=None) as page:
        page.send(msgspec.msgpack.encode(CAMERA))
        end = monotonic() + SETTLE + seconds
        while (now := monotonic()) < end:
            try:
                data = page.recv(timeout=end - now)
            except TimeoutError:
                break
            if isinstance(data, bytes) and monotonic() > end - seconds:
                length = int.from_bytes(data[8:16], "little")
                words = zstandard.ZstdDecompressor().decompress(data[16 : 16 + length])
                grounds, size = grounds + (GROUND in words), size + len(data)
                if MOVES in words:
                    moves.append(monotonic())
    longest = max(np.diff([end - seconds, *moves, end]).tolist())
    found = {"moves_hz": len(moves) / seconds, "ground_hz": grounds / seconds, "mb_s": 1e-6 * size / seconds}
    print(json.dumps({**found, "longest_s": longest}))


if __name__ == "__main__":
    main()
