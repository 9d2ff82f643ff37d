"""What belongs to the rotation, each function under its name and all of them in one."""

import functools

import jax.numpy as jnp
import numpy as np

import jaxrot
from jaxrot import STEPS, polar_decomposition, refine_rotation, rotation_variant_svd, twist_modes


def bounded(s):
    """An energy that does not overflow."""
    return jnp.sum(jnp.tanh(s))


PARTS = {
    "polar_decomposition": lambda a: polar_decomposition(a).stretch,
    "rotation_variant_svd": lambda a: rotation_variant_svd(a).right,
    "twist_modes": lambda a: twist_modes(a).modes,
    "isotropic_energy": lambda a: jaxrot.isotropic_energy(a, bounded),
    "isotropic_map": lambda a: jaxrot.isotropic_map(a, jnp.tanh),
}
for name in ("signed_singular_values", "rotation_gap", "rotation_jacobian", "arap_hessian"):
    PARTS[name] = getattr(jaxrot, name)

EYE = np.eye(3, dtype=np.float32)
REFINED = {f"refine_rotation {step}": functools.partial(refine_rotation, rotation=EYE, step=step) for step in STEPS}


def decomposition(matrix):
    """What the decompositions return, and the gap, of every matrix in one row."""
    return _rows(polar_decomposition(matrix).stretch, *rotation_variant_svd(matrix), jaxrot.rotation_gap(matrix))


def dense(matrix):
    """The entries of the 9×9 matrices and of their modes, of every matrix in one row."""
    return _rows(jaxrot.rotation_jacobian(matrix), *twist_modes(matrix), jaxrot.arap_hessian(matrix))


def all_parts(matrix):
    """Every part of every matrix in one row, so that tests which only compile do it once."""
    isotropic = _rows(jaxrot.isotropic_map(matrix, jnp.tanh), jaxrot.isotropic_energy(matrix, bounded))
    return jnp.concatenate([decomposition(matrix), dense(matrix), isotropic], axis=-1)


def _rows(first, *others):
    batch = first.shape[:-2]
    return jnp.concatenate([part.reshape(*batch, -1) for part in (first, *others)], axis=-1)
