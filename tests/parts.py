"""What belongs to the rotation, each function under its name and all of them in one."""

import functools

import jax.numpy as jnp
import numpy as np

from jaxrot import (
    STEPS,
    arap_hessian,
    isotropic_energy,
    isotropic_map,
    polar_decomposition,
    refine_rotation,
    rotation_gap,
    rotation_jacobian,
    rotation_variant_svd,
    signed_singular_values,
    twist_modes,
)


def bounded(s):
    """An energy that does not overflow."""
    return jnp.sum(jnp.tanh(s))


PARTS = {
    "polar_decomposition": lambda a: polar_decomposition(a).stretch,
    "rotation_variant_svd": lambda a: rotation_variant_svd(a).right,
    "signed_singular_values": signed_singular_values,
    "rotation_gap": rotation_gap,
    "rotation_jacobian": rotation_jacobian,
    "twist_modes": lambda a: twist_modes(a).modes,
    "arap_hessian": arap_hessian,
    "isotropic_energy": lambda a: isotropic_energy(a, bounded),
    "isotropic_map": lambda a: isotropic_map(a, jnp.tanh),
}


EYE = np.eye(3, dtype=np.float32)
REFINED = {f"refine_rotation {step}": functools.partial(refine_rotation, rotation=EYE, step=step) for step in STEPS}


def decomposition(matrix):
    """What the decompositions return, and the gap, of every matrix in one row."""
    return _rows(polar_decomposition(matrix).stretch, *rotation_variant_svd(matrix), rotation_gap(matrix))


def dense(matrix):
    """The entries of the 9×9 matrices and of their modes, of every matrix in one row."""
    return _rows(rotation_jacobian(matrix), *twist_modes(matrix), arap_hessian(matrix))


def all_parts(matrix):
    """Every part of every matrix in one row, so that tests which only compile do it once."""
    isotropic = _rows(isotropic_map(matrix, jnp.tanh), isotropic_energy(matrix, bounded))
    return jnp.concatenate([decomposition(matrix), dense(matrix), isotropic], axis=-1)


def _rows(first, *others):
    batch = first.shape[:-2]
    return jnp.concatenate([part.reshape(*batch, -1) for part in (first, *others)], axis=-1)
