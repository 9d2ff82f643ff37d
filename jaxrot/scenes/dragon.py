"""The Stanford dragon, the mesh of Müller et al. 2016, Fig. 7; its acknowledgement is in `dragon.txt`."""

from importlib import resources

import numpy as np


def rest_vertices(*, fine: bool = False) -> np.ndarray:
    """The vertices at rest, centred and one unit high, the second axis up.

    Args:
        fine: 22,998 vertices instead of 5,205.

    Returns:
        float64 of shape (n, 3).
    """
    file_name = "dragon_fine.npz" if fine else "dragon.npz"
    with resources.files("jaxrot.scenes").joinpath(file_name).open("rb") as file, np.load(file) as archive:
        vertices = archive["vertices"].astype(np.float64)
    lower, upper = vertices.min(axis=0), vertices.max(axis=0)
    return (vertices - (lower + upper) / 2) / (upper[1] - lower[1])
