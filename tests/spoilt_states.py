"""What becomes of the file of a saved state."""

import io
import pickle
import zipfile

import numpy as np


def spoilt(data: bytes, how: str, at: float) -> bytes:
    """Return what became of a state: cut off, changed in a byte, or another file altogether."""
    place = int(at * len(data))
    if how == "cut off":
        return data[:place]
    if how == "changed":
        return data[:place] + bytes([data[place] ^ (1 + place % 255)]) + data[place + 1 :]
    if how == "longer":
        return data + data[: place + 1]
    file = io.BytesIO()
    if how == "another zip":
        with zipfile.ZipFile(file, "w") as archive:
            archive.writestr("world.txt", data[:place])
    elif how == "another npz":
        np.savez(file, state=np.frombuffer(data, np.uint8)[:place])
    elif how == "pickle":
        pickle.dump(data[:place], file)
    else:
        return np.random.default_rng(place).bytes(place)
    return file.getvalue()


HOWS = ("cut off", "changed", "longer", "another zip", "another npz", "pickle", "noise")
