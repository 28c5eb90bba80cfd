# SPDX-License-Identifier: Apache-2.0
"""The worst paths that searches have found: `make check` tries each again, `make soak` searches on from it."""

from pathlib import Path

import numpy as np
from examples import searching, tries

from adversary.exchange_search import search

FILE = Path(__file__).with_name("worst_paths.npz")


def worst(name, settings, against, evaluations, seed):
    """Found of the path kept by this name; where hypothesis' profile is to search, of a search, whose best is kept."""
    kept = dict(np.load(FILE)) if FILE.exists() else {}
    if not searching():
        return search(settings, against, evaluations=1, seed=seed, start=kept[name].astype(float))
    start = kept[name].astype(float) if name in kept else None
    found = search(settings, against, evaluations=tries(evaluations), seed=seed, start=start)
    path = found.path.astype(np.float32)
    if name not in kept or not np.array_equal(path, kept[name]):
        np.savez_compressed(FILE, **kept | {name: path})
    return found
