"""The default method with one of its guards left out, composed of its own stages."""

import jax

from jaxrot._algebra import mat3
from jaxrot._algebra.scaling import scaled
from jaxrot.solvers import singular_pair

GUARDS = ("scale", "largest column", "nearer reflection", "rotations as they are", "renormalisation")


def solve(matrix: jax.Array, without: str = "") -> jax.Array:
    """The nearest rotations of matrices (..., 3, 3), without one stage.

    Args:
        matrix: (..., 3, 3), float32 or float64.
        without: A name in `GUARDS`. With "" the result is that of the library's own program.
    """
    a = mat3.components(matrix)
    if without != "scale":
        a = scaled(a)
    gram = singular_pair.deviator(a)
    outer = singular_pair.outer_eigenvalue(gram)
    x, y = singular_pair.eigenvector(gram, outer, is_chosen=without != "largest column")
    images = singular_pair.reflected(a, x, y)
    axis = singular_pair.image_of_axis(images, outer < 0, is_nearer=without != "nearer reflection")
    cosine, sine, trace = singular_pair.half_angle(images, axis)
    q = singular_pair.composed((x, y), axis, cosine, sine)
    r = singular_pair.rotation(a, q, gram, trace, is_kept=without != "rotations as they are")
    return mat3.stack(r if without == "renormalisation" else mat3.newton_schulz(r))
