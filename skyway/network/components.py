"""Which stations hang together."""

import numpy as np
import numpy.typing as npt

Indices = npt.NDArray[np.int64]


def components(one: Indices, other: Indices, *, stations: int) -> Indices:
    """The smallest row of each station's component, ``(n,)``; lines join both ways.

    Every component's smallest row is a tree's root; roots with a smaller neighbour hang themselves
    below it, and the trees are flattened, until no line joins two of them: about log n rounds.
    """
    root = np.arange(stations)
    while True:
        root_one, root_other = root[one], root[other]
        is_apart = root_one != root_other
        if not is_apart.any():
            return root
        one, other = one[is_apart], other[is_apart]
        root_one, root_other = root_one[is_apart], root_other[is_apart]
        np.minimum.at(root, np.maximum(root_one, root_other), np.minimum(root_one, root_other))
        while not np.array_equal(root, flatter := root[root]):
            root = flatter
