"""Solvers for the nearest rotation from a cold start, one algorithm a file, and their registry."""

from collections.abc import Callable, Mapping
from typing import NamedTuple

from jaxrot._algebra.mat3 import Mat3
from jaxrot._frozen import FrozenMapping
from jaxrot.solvers import (
    cayley,
    davenport,
    foam,
    gram_schmidt,
    higham_newton,
    higham_noferini,
    horn_quartic,
    implicit_qr_svd,
    inverse_square_root,
    irving,
    jacobi_svd,
    quaternion_average,
    shepperd_markley,
    singular_pair,
    smith_franca,
    squaring,
    svd,
    taylor,
    torque,
)


class Method(NamedTuple):
    """A method of `nearest_rotation`: a solver and its domain.

    Attributes:
        solve: Maps a matrix on components to a rotation on components. A power of two has scaled its largest entry into
            [2, 4). It has no derivative rule.
        exact: Whether it computes the nearest rotation up to rounding, not an approximation of it.
        handles_inversion: Whether it is right for det A < 0 too.
        condition_limit: By dtype, the largest condition number κ = s1/(s2+s3), a power of two, up to which it keeps the
            numerical contract of the default method: forward error 8 eps (1+κ), orthogonality 10 eps, lost trace
            16 eps s1, torque 128 eps s1. It is measured over all families that the flags allow. 0 means that the
            contract does not even hold near κ = 1/2, the κ of a rotation.
        source: The publication.
    """

    solve: Callable[[Mat3], Mat3]
    exact: bool
    handles_inversion: bool
    condition_limit: Mapping[str, float]
    source: str


def _limit(float32: float, float64: float) -> Mapping[str, float]:
    return FrozenMapping({"float32": float32, "float64": float64})


# The fastest method that keeps the whole contract, also for singular, inverted and extreme matrices.
DEFAULT_METHOD = "singular_pair"

METHODS: Mapping[str, Method] = FrozenMapping(
    {
        "singular_pair": Method(
            solve=singular_pair.solve,
            exact=True,
            handles_inversion=True,
            condition_limit=_limit(2.0**20, 2.0**49),
            source="Wahba's problem on a circle; Smith 1961",
        ),
        "svd": Method(
            solve=svd.solve,
            exact=True,
            handles_inversion=True,
            condition_limit=_limit(0, 0),
            source="LAPACK; Kabsch 1976",
        ),
        "davenport": Method(
            solve=davenport.solve,
            exact=True,
            handles_inversion=True,
            condition_limit=_limit(0, 0),
            source="Davenport's q-method; Horn 1987",
        ),
        "smith_franca": Method(
            solve=smith_franca.solve,
            exact=True,
            handles_inversion=False,
            condition_limit=_limit(0, 0),
            source="Sarabandi et al. 2020, eq. (16)",
        ),
        "quaternion_average": Method(
            solve=quaternion_average.solve,
            exact=False,
            handles_inversion=False,
            condition_limit=_limit(0, 0),
            source="Sarabandi et al. 2020, eq. (30)",
        ),
        "cayley": Method(
            solve=cayley.solve,
            exact=False,
            handles_inversion=False,
            condition_limit=_limit(0, 0),
            source="Sarabandi et al. 2020, eq. (31)",
        ),
        "foam": Method(
            solve=foam.solve,
            exact=True,
            handles_inversion=True,
            condition_limit=_limit(0.5, 0.5),
            source="Markley 1993",
        ),
        "squaring": Method(
            solve=squaring.solve,
            exact=True,
            handles_inversion=True,
            condition_limit=_limit(2.0**20, 2.0**49),
            source="Wu et al. 2018 (FA3R)",
        ),
        "irving": Method(
            solve=irving.solve,
            exact=True,
            handles_inversion=True,
            condition_limit=_limit(0, 0),
            source="Irving et al. 2004; Müller et al. 2016, appendix C",
        ),
        "gram_schmidt": Method(
            solve=gram_schmidt.solve,
            exact=False,
            handles_inversion=False,
            condition_limit=_limit(0, 0),
            source="Müller et al. 2016, section 2",
        ),
        "inverse_square_root": Method(
            solve=inverse_square_root.solve,
            exact=True,
            handles_inversion=False,
            condition_limit=_limit(0, 0),
            source="Wessner 1966; Sarabandi et al. 2020, eq. (2)",
        ),
        "higham_newton": Method(
            solve=higham_newton.solve,
            exact=True,
            handles_inversion=False,
            condition_limit=_limit(0.5, 0.5),
            source="Higham 1986",
        ),
        "taylor": Method(
            solve=taylor.solve,
            exact=False,
            handles_inversion=False,
            condition_limit=_limit(0, 0),
            source="Sarabandi et al. 2020, eq. (20)",
        ),
        "taylor_iterated": Method(
            solve=taylor.solve_iterated,
            exact=True,
            handles_inversion=False,
            condition_limit=_limit(0.5, 0.5),
            source="Hasan 2009",
        ),
        "shepperd_markley": Method(
            solve=shepperd_markley.solve,
            exact=False,
            handles_inversion=False,
            condition_limit=_limit(0, 0),
            source="Shepperd 1978; Markley 2008",
        ),
        "simple_average": Method(
            solve=quaternion_average.solve_simply,
            exact=False,
            handles_inversion=False,
            condition_limit=_limit(0, 0),
            source="Sarabandi et al. 2020, eq. (29)",
        ),
        "horn_quartic": Method(
            solve=horn_quartic.solve,
            exact=True,
            handles_inversion=True,
            condition_limit=_limit(2, 2),
            source="Horn 1987",
        ),
        "higham_noferini": Method(
            solve=higham_noferini.solve,
            exact=True,
            handles_inversion=True,
            condition_limit=_limit(2, 2),
            source="Higham and Noferini 2016",
        ),
        "jacobi_svd": Method(
            solve=jacobi_svd.solve,
            exact=True,
            handles_inversion=True,
            condition_limit=_limit(2.0**20, 2.0**49),
            source="Kogbetliantz 1955",
        ),
        "implicit_qr_svd": Method(
            solve=implicit_qr_svd.solve,
            exact=True,
            handles_inversion=True,
            condition_limit=_limit(2.0**20, 2.0**49),
            source="Gast et al. 2016",
        ),
        "torque": Method(
            solve=torque.solve,
            exact=False,
            handles_inversion=True,
            condition_limit=_limit(0, 0),
            source="Müller et al. 2016, section 3",
        ),
    }
)
