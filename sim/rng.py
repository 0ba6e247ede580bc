"""Named random streams: one generator per source, independent of call order and of every other source."""

from zlib import crc32

import numpy as np


def stream(seed: int, flight: int, name: str) -> np.random.Generator:
    """Generator of the source `name` in flight number `flight` of the campaign `seed`.

    Flight k alone draws the same as flight k of a campaign, on any number of workers; adding a source changes no
    other source (NumPy, SeedSequence and its spawn_key).
    """
    return np.random.Generator(np.random.PCG64(np.random.SeedSequence(seed, spawn_key=(flight, crc32(name.encode())))))
