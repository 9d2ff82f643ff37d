"""The conversion of a rotation matrix to a quaternion, applied to a matrix that is not a rotation."""

from jaxrot._algebra import quaternion
from jaxrot._algebra.mat3 import Mat3
from jaxrot._algebra.scaling import unit_scaled


def solve(a: Mat3) -> Mat3:
    """An approximation of the nearest rotation: always a rotation, by few multiplications.

    For a rotation the columns of 1 + N(A) are multiples of its quaternion. For a noisy one the largest is taken.

    Returns:
        Rotations, exact for multiples of a rotation.

    Cost: 100 flops and one square root, for the scale.
    Source: Shepperd 1978; Markley, "Unit quaternion from rotation matrix", 2008: [30] of Sarabandi et al. 2020. They
    assume the scale 1; the scale is removed first.
    """
    columns = quaternion.davenport_columns(unit_scaled(a))
    # Never 0: the four diagonal entries add up to 4.
    return quaternion.to_orthonormal(quaternion.largest_column(columns))
