"""Functions of the singular values: the derivatives that a composition of U, s and V does not have."""

import functools
import itertools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from certificate import assert_within, family_batch
from isotropic_reference import LOWER, MATERIALS, UPPER, derivatives
from marks import mostly_exhaustive

from jaxrot import isotropic_energy, isotropic_map, rotation_variant_svd, signed_singular_values
from jaxrot.families import FAMILIES

POSITIVE = {
    "rest": (1, 1, 1),
    "two equal": (2, 2, 1),
    "smaller two equal": (2, 1, 1),
    "1e-2 apart": (1.01, 1, 0.7),
    "1e-3 apart": (1.001, 1, 0.7),
    "1e-5 apart": (1 + 1e-5, 1, 0.7),
    "1e-7 apart": (1 + 1e-7, 1, 0.7),
    "all 1e-5 apart": (1 + 1e-5, 1, 1 - 1e-5),
    "on both sides of a kink": (1.01, 1.005, 0.98),
    "far apart": (1.5, 1, 0.4),
    "in Pa": (1e3, 9e2, 1e2),
}
# Where every smooth function of A is smooth, a rotation included.
SINGULAR = {"rank 2": (1, 0.5, 0), "inverted": (1, 0.5, -0.3), "inverted, equal": (1, 1 - 1e-5, -0.3)}
# Where R is not unique: functions that need it are not smooth.
NOT_UNIQUE = {"rank 1": (1, 0, 0), "mirror": (1, 1, -1), "half inverted": (1, 0.5, -0.5), "close": (1, 0.5, -0.499999)}
NEEDS_POSITIVE = {"hencky", "neo_hookean", "logarithm"}
NEEDS_ROTATION = {"corotated", "snow"}


def cases(material):
    found = dict(POSITIVE)
    if material not in NEEDS_POSITIVE:
        found |= SINGULAR
        if material not in NEEDS_ROTATION:
            found |= NOT_UNIQUE
    return found


def matrices(material, dtype):
    """Each spectrum on the diagonal, and between two rotations."""
    spectra = np.array([*cases(material).values()], np.longdouble)
    u, v = (FAMILIES["rotation"].sample(len(spectra), np.float64, seed).matrices for seed in (1, 2))
    diagonal = spectra[:, :, None] * np.eye(3)
    return np.concatenate([diagonal, u @ diagonal @ v.swapaxes(1, 2)]).astype(dtype)


@functools.lru_cache
def exact(material, dtype, vectors="left_right"):
    pairs = [derivatives(matrix, MATERIALS[material], vectors) for matrix in matrices(material, dtype)]
    return np.stack([value for value, _ in pairs]), np.stack([jacobian for _, jacobian in pairs])


def norm(x):
    return np.sqrt((x.reshape(len(x), -1) ** 2).sum(-1))


def assert_close(got, expected, bound, names):
    error = norm(np.asarray(got, np.float64).reshape(expected.shape) - expected)
    worst = np.argmax(error / bound)
    assert error[worst] <= bound[worst], f"{names[worst % len(names)]}: {error[worst] / bound[worst]:.3g} of the bound"


def assert_exact(function, mode, material, dtype, vectors="left_right"):
    """The value and the derivative are those of the exact decomposition."""
    a, eps, names = matrices(material, dtype), np.finfo(dtype).eps, list(cases(material))
    value, jacobian = exact(material, dtype, vectors)
    size = np.abs(a).max(axis=(1, 2))
    got_value, got_jacobian = jax.jit(jax.vmap(lambda a: (function(a), mode(function)(a))))(a)
    assert_close(got_value, value, 64 * eps * (norm(value) + size * norm(jacobian)), names)
    assert_close(got_jacobian, jacobian, 1024 * eps * (norm(jacobian) + norm(value) / size), names)


IN_SHORT = {("hencky", "float64", jax.jacrev), ("snow", "float32", jax.jacfwd)}
CASES = itertools.product(MATERIALS, ("float32", "float64"), (jax.jacfwd, jax.jacrev))


@pytest.mark.parametrize(("material", "dtype", "mode"), mostly_exhaustive(CASES, *IN_SHORT))
def test_value_and_derivative_are_those_of_the_exact_decomposition(material, dtype, mode):
    record = MATERIALS[material]
    if record.energy is None:
        function = functools.partial(isotropic_map, function=record.function)
    else:
        function = jax.grad(lambda a: isotropic_energy(a, record.energy))
    assert_exact(function, mode, material, dtype)


@pytest.mark.parametrize("vectors", mostly_exhaustive(["left", "right"], "right"))
@pytest.mark.parametrize("material", mostly_exhaustive(["logarithm", "snow"], "logarithm"))
def test_functions_of_the_left_and_of_the_right_stretch(material, vectors):
    function = functools.partial(isotropic_map, function=MATERIALS[material].function, vectors=vectors)
    assert_exact(function, jax.jacfwd, material, "float64", vectors)


def test_the_derivatives_of_the_product_are_those_of_the_determinant_everywhere():
    determinant = lambda a: jnp.dot(a[0], jnp.cross(a[1], a[2]))  # noqa: E731
    product = lambda a: isotropic_energy(a, jnp.prod)  # noqa: E731
    special = np.stack([np.zeros((3, 3)), np.eye(3), -np.eye(3), np.diag([1.0, 1, -1]), np.diag([1.0, 0, 0])])
    orders = (jax.vmap(lambda a, f=f: (f(a), jax.grad(f)(a), jax.hessian(f)(a))) for f in (product, determinant))
    for got, expected in zip(*(jax.jit(function)(special) for function in orders), strict=True):
        np.testing.assert_allclose(got, expected, atol=1e-14)


@pytest.mark.exhaustive
def test_the_compositions_that_the_docstrings_warn_of_are_wrong():
    """If this fails they have become right, and the docstrings must not warn of them."""
    psi = lambda a: jnp.sum(jnp.log(signed_singular_values(a)) ** 2)  # noqa: E731
    eigenvalues = np.linalg.eigvalsh(jax.hessian(psi)(np.eye(3)).reshape(9, 9))
    assert (eigenvalues > 1).sum() == 3  # right are 6

    def clamped(a):
        u, s, v = rotation_variant_svd(a)
        return (u * jnp.clip(s, LOWER, UPPER)[None]) @ v.T

    shear = np.array([[0, 1.0, 0], [1, 0, 0], [0, 0, 0]])
    along = jax.jvp(clamped, (np.eye(3),), (shear,))[1]
    right = jax.jvp(lambda a: isotropic_map(a, lambda s: jnp.clip(s, LOWER, UPPER)), (np.eye(3),), (shear,))[1]
    np.testing.assert_allclose(right, shear, atol=1e-15)
    assert np.abs(along - right).max() > 0.5


def test_a_function_without_scale_is_right_at_every_scale(dtype):
    angle = lambda s: s / jnp.sqrt(jnp.sum(s * s))  # noqa: E731
    a = matrices("snow", dtype)
    jacobian = jax.jit(jax.vmap(jax.jacfwd(functools.partial(isotropic_map, function=angle))))
    expected = np.asarray(jacobian(a))
    for exponent in (-30, 30):
        got = np.ldexp(np.asarray(jacobian(np.ldexp(a, exponent))), exponent)
        np.testing.assert_allclose(got, expected, atol=1e3 * np.finfo(dtype).eps * np.abs(expected).max())


@pytest.mark.exhaustive
def test_where_the_rotation_is_not_unique_the_derivative_is_finite_and_damped():
    energy = MATERIALS["corotated"].energy
    a = np.stack([np.zeros((3, 3)), -np.eye(3), np.diag([1.0, 0, 0]), np.diag([1, 0.5, -0.5])]).astype(np.float32)
    hessian = jax.jit(jax.vmap(jax.hessian(lambda a: isotropic_energy(a, energy))))
    assert np.isfinite(hessian(a)).all()
    batch = family_batch("float32")
    # Beyond these the energy itself overflows.
    where = (batch.singular_values[:, 0] < 1e18) & np.isfinite(batch.matrices).all(axis=(1, 2))
    largest = np.abs(np.asarray(hessian(batch.matrices[where]))).max(axis=(1, 2, 3, 4))
    assert_within(largest, np.finfo(np.float32).max, batch.families[where], "finite Hessian")


@pytest.mark.exhaustive
def test_parameters_that_are_closed_over_have_derivatives():
    a = matrices("snow", "float64")[3]

    def energy(a, mu):
        return isotropic_energy(a, lambda s: mu[0] * jnp.sum((s - 1) ** 2) + mu[1] ** 2 * jnp.prod(s))

    mu = np.array([0.7, 1.3])
    s = np.linalg.svd(a, compute_uv=False)
    np.testing.assert_allclose(jax.grad(energy, 1)(a, mu), [np.sum((s - 1) ** 2), 2 * mu[1] * np.prod(s)])
    stress = jax.jit(jax.grad(energy))
    for mode in (jax.jacfwd, jax.jacrev):
        sensitivity = np.asarray(mode(stress, 1)(a, mu))
        for k in range(2):
            step = 1e-6 * np.eye(2)[k]
            difference = (np.asarray(stress(a, mu + step)) - np.asarray(stress(a, mu - step))) / 2e-6
            np.testing.assert_allclose(sensitivity[..., k], difference, atol=1e-8)
    # A parameter for each matrix: the function closes over what vmap batches.
    batch = np.stack([a, 2 * a])
    np.testing.assert_allclose(jax.vmap(energy)(batch, np.stack([mu, mu])), [energy(x, mu) for x in batch])


@pytest.mark.parametrize("material", mostly_exhaustive(["hencky", "corotated"], "hencky"))
def test_a_solver_finds_the_state_of_rest(material):
    """With a Hessian that is wrong at rest, where singular values are equal, Newton's method converges linearly."""
    energy = lambda a: isotropic_energy(a, MATERIALS[material].energy)  # noqa: E731
    a = np.eye(3) + 0.02 * np.random.default_rng(3).standard_normal((3, 3))
    step = jax.jit(lambda a: (jax.grad(energy)(a), jax.hessian(energy)(a).reshape(9, 9)))
    errors = []
    for _ in range(4):
        gradient, hessian = map(np.asarray, step(a))
        a = a - (np.linalg.pinv(hessian, rcond=1e-6) @ gradient.ravel()).reshape(3, 3)
        errors.append(np.abs(a.T @ a - np.eye(3)).max())
    assert errors[-1] < 1e-14


@pytest.mark.parametrize(
    ("call", "error", "message"),
    [
        (lambda a: isotropic_energy(a, lambda s: s), ValueError, r"an array of shape \(\) .* got shape \(3,\)"),
        (lambda a: isotropic_energy(a, lambda s: (s, s)), ValueError, "energy must return an array .* got tuple"),
        (lambda a: isotropic_energy(a, lambda s: None), ValueError, "energy must return an array .* got NoneType"),
        (lambda a: isotropic_energy(a, "hencky"), TypeError, "energy must be a function; got str"),
        (lambda a: isotropic_map(a, jnp.sum), ValueError, r"must return an array of shape \(3,\) .* got shape \(\)"),
        (lambda a: isotropic_map(a, lambda s: s.astype(complex)), TypeError, "real floating.*got dtype complex128"),
        (lambda a: isotropic_map(a, jnp.log, vectors="both"), ValueError, "one of left, left_right, right; got 'both'"),
    ],
)
def test_a_bad_function_is_refused_at_trace_time(call, error, message):
    with pytest.raises(error, match=message):
        jax.jit(call)(np.eye(3))


def test_an_object_that_changes_is_not_taken_for_the_one_before():
    class Model:
        stiffness = 1.0

        def energy(self, s):
            return self.stiffness * jnp.sum(s * s)

    model = Model()
    first = isotropic_energy(np.eye(3), model.energy)
    model.stiffness = 2.0
    assert isotropic_energy(np.eye(3), model.energy) == 2 * first
