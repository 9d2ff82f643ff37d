"""The conversion of a rotation matrix to a quaternion, applied to a matrix that is none."""

import jax

from jaxrot import _mat3, _quaternion
from jaxrot._scaling import unit_scaled


def solve(matrix: jax.Array) -> jax.Array:
    """An approximation of the nearest rotation: always a rotation, by few multiplications.

    The columns of 1 + N(A) are, for a rotation, multiples of one quaternion; of a noisy one's the largest is taken.

    Args:
        matrix: (..., 3, 3), float32 or float64, any scale.

    Returns:
        (..., 3, 3) rotations, exact for multiples of a rotation.

    Cost: 100 flops and one square root, for the scale.
    Source: Shepperd 1978; Markley, "Unit quaternion from rotation matrix", 2008: [30] of Sarabandi et al. 2020. The
    scale, which it takes to be 1, is removed first.
    """
    columns = _quaternion.davenport_columns(unit_scaled(_mat3.components(matrix)))
    # Never 0: the four diagonal entries add up to 4.
    return _quaternion.to_matrix(_quaternion.largest_column(columns))
