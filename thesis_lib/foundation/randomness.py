"""Independent random streams.

The generator of each rule derives from the single seed of the configuration and a key (rule name and wildcards), so
that an additional rule, law or dataset changes no other result.
"""

import hashlib
from collections.abc import Callable

import numpy as np


def generator(seed: int, *key: str) -> np.random.Generator:
    """Generator for the stream named by `key`; equal arguments give equal streams on every machine.

    >>> generator(0, "ch3_identify", "drops").integers(100) == generator(0, "ch3_identify", "drops").integers(100)
    True
    """
    digest = hashlib.sha256("\x1f".join(key).encode()).digest()
    spawn_key = tuple(int.from_bytes(digest[i : i + 4], "big") for i in range(0, 16, 4))
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=spawn_key))


def streams(rng: np.random.Generator) -> Callable[..., np.random.Generator]:
    """Function from a name (words or numbers) to a separate stream; all derive from one draw of `rng`.

    A loop over models or programs uses one stream for each, so that an additional model changes no draw of the others.

    >>> a, b = (streams(np.random.default_rng(0)) for _ in range(2))
    >>> _ = b("another").random()
    >>> a("law", 3).random() == b("law", 3).random()
    True
    """
    seed = int(rng.integers(2**63))
    return lambda *key: generator(seed, *map(str, key))
