"""The contract of the default method, sought to be broken: many matrices, bit patterns, hypothesis."""

import functools
import itertools

import hypothesis
import hypothesis.extra.numpy as arrays
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from certificate import Batch, assert_contract, assert_forward_error, family_batch, in_families, resolved
from hypothesis import strategies

from jaxrot import nearest_rotation
from jaxrot.evaluation import reference
from jaxrot.report.measure import ablated_method

BITS = {"float32": np.uint32, "float64": np.uint64}
COUNT = 64  # one shape, so that hypothesis compiles once a dtype

nearest = jax.jit(nearest_rotation)


def judged(matrices):
    """The finite ones, of the given ones, with their reference."""
    finite = np.isfinite(matrices).all(axis=(1, 2))
    safe = np.where(finite[:, None, None], matrices, np.eye(3, dtype=matrices.dtype))
    return Batch(
        safe,
        np.asarray(reference.signed_singular_values(safe)),
        np.full(len(safe), "given", object),
        np.asarray(reference.condition(safe)),
        np.asarray(reference.reference_rotation(safe)),
    )


def assert_kept(matrices):
    batch = judged(matrices)
    rotation = np.asarray(nearest(batch.matrices))
    assert_contract(rotation, batch)
    finite = np.isfinite(matrices).all(axis=(1, 2))
    assert np.isnan(np.asarray(nearest(matrices))[~finite]).all()


@pytest.mark.exhaustive
def test_the_contract_holds_with_a_margin_of_two_on_many_matrices_of_every_family(dtype):
    """LAPACK in float32 is up to 11 eps (1 + κ) off; a third of that is less than the 4 asked here.

    Not up to the last κ: there one in a million matrices, near −R, is 4.4 eps (1 + κ) off.
    """
    batch = family_batch(dtype, count=600, seed=5)
    rotation = np.asarray(nearest(batch.matrices))
    assert_contract(rotation, batch)
    assert_forward_error(rotation, batch, resolved(batch, 1 / (32 * np.finfo(dtype).eps)), bound=4)


def test_random_bit_patterns_keep_the_contract(dtype):
    most = np.iinfo(BITS[dtype]).max
    bits = np.random.default_rng(0).integers(0, most, (64, COUNT, 3, 3), BITS[dtype], endpoint=True)
    for matrices in bits.view(dtype):
        assert_kept(matrices)


def with_bits(dtype):
    return arrays.arrays(BITS[dtype], (COUNT, 3, 3)).map(lambda bits: bits.view(dtype))


def graded(dtype):
    """Signed small integers times powers of two, with ties, zeros and exact rank deficiencies among them."""
    shape = (COUNT, 3, 3)
    integer = arrays.arrays(np.int8, shape, elements=strategies.integers(-4, 4))
    exponent = arrays.arrays(np.int16, shape, elements=strategies.integers(-40, 0))
    return strategies.tuples(integer, exponent).map(lambda x: np.ldexp(x[0].astype(dtype), x[1]).astype(dtype))


def near_minus_rotations(dtype):
    """−R plus few units in the last place: two gaps close at once."""
    turns = np.asarray(nearest(np.random.default_rng(0).standard_normal((COUNT, 3, 3)).astype(dtype)))
    steps = arrays.arrays(np.int64, (COUNT, 3, 3), elements=strategies.integers(-(2**12), 2**12))
    return steps.map(lambda n: (n.astype(dtype) * np.finfo(dtype).eps - turns).astype(dtype))


FAST = hypothesis.settings(max_examples=30, deadline=None, derandomize=True, database=None)


@pytest.mark.parametrize("kind", [with_bits, graded, near_minus_rotations])
def test_hypothesis_does_not_break_the_contract(dtype, kind):
    @FAST
    @hypothesis.given(kind(dtype))
    def holds(matrices):
        assert_kept(matrices)

    holds()


def test_climbing_by_units_in_the_last_place_does_not_break_the_contract(dtype):
    """From the worst matrix of every family: of 16 neighbours the worst one follows, 12 times."""
    batch = family_batch(dtype, count=24)
    random, eps = np.random.default_rng(0), np.finfo(dtype).eps
    names = sorted(set(batch.families.tolist()))
    current = np.stack([batch.matrices[batch.families == name][0] for name in names])
    for _ in range(12):
        steps = random.integers(-2, 3, (16, *current.shape)).astype(dtype)
        steps[0] = 0
        neighbours = (current * (1 + steps * eps)).astype(dtype).reshape(-1, 3, 3)
        candidates = judged(neighbours)
        rotation = np.asarray(nearest(neighbours))
        assert_contract(rotation, candidates)
        error = np.linalg.norm((rotation - candidates.nearest).astype(float), axis=(1, 2)) / (1 + candidates.condition)
        worst = np.where(resolved(candidates), error, 0).reshape(16, -1).argmax(0)
        current = neighbours.reshape(16, *current.shape)[worst, np.arange(len(current))]


@pytest.mark.parametrize("guard", [name for name in ablated_method.GUARDS if name != "rotations as they are"])
def test_every_stage_is_needed(guard):
    """Without it the contract breaks, on a family that it is there for."""
    batch = family_batch("float64")
    families = {
        "scale": ["scale_large", "scale_huge"],
        "largest column": ["planar", "small_integers"],
        "nearer reflection": ["signed_permutation", "planar_motion"],
        "renormalisation": ["drifted_rotation"],
    }[guard]
    rotation = np.asarray(jax.jit(functools.partial(ablated_method.solve, without=guard))(batch.matrices))
    where = in_families(batch, families)
    part = Batch(*(entry[where] for entry in batch))
    with pytest.raises(AssertionError):
        assert_contract(rotation[where], part)


def test_a_rotation_comes_back_as_it_is(dtype):
    """A rounded one to half an eps an entry, one that is off by 2 eps to 2 eps."""
    random, eps = np.random.default_rng(2), np.finfo(dtype).eps
    exact = np.asarray(reference.reference_rotation(random.standard_normal((4096, 3, 3))))
    rounded = exact.astype(dtype)
    assert np.abs(np.asarray(nearest(rounded)) - rounded).max() <= 0.5 * eps
    noise = random.standard_normal(exact.shape)
    noise *= 1.5 * eps / np.linalg.norm(noise, axis=(1, 2), keepdims=True)
    noisy = (exact + noise).astype(dtype)
    assert np.abs(np.asarray(nearest(noisy)) - noisy).max() <= 2 * eps


@pytest.mark.parametrize("run", [ablated_method.solve, nearest], ids=["operations", "program"])
def test_simple_matrices_have_exact_rotations(run, dtype):
    def solved(matrix):
        return np.asarray(run(np.asarray(matrix, dtype)))

    for scale in (0, 1, 3, 0.1, 1e-30, np.pi):
        np.testing.assert_array_equal(solved(scale * np.eye(3)), np.eye(3))
    for diagonal in ((1, 1, 0), (2, 0, 0), (0, 3, 0), (1, 0, 1), (3, 2, 1), (1, 5, 5)):
        np.testing.assert_array_equal(solved(np.diag(diagonal)), np.eye(3))
    for order in itertools.permutations(range(3)):
        for signs in itertools.product((1, -1), repeat=3):
            permutation = np.eye(3)[list(order)] * signs
            if np.linalg.det(permutation) > 0:
                np.testing.assert_array_equal(solved(permutation * 2.0**-7), permutation)


def test_the_name_of_the_default_before_is_an_alias():
    matrix = np.random.default_rng(3).standard_normal((3, 3))
    with pytest.warns(DeprecationWarning, match="'half_turn' was replaced by 'singular_pair'"):
        np.testing.assert_array_equal(nearest_rotation(matrix, method="half_turn"), nearest_rotation(matrix))


def test_where_a_matrix_stands_in_the_batch_changes_no_bit(dtype):
    """In one compiled program; where R is not unique another program may return another."""
    n = np.array([1, 2, 2]) / 3
    special = [np.eye(3) - 2 * np.outer(n, n), -np.eye(3), np.diag([1, 0, 0]), np.diag([1.0, 0.5, -0.5])]
    special += list(np.random.default_rng(5).standard_normal((4, 3, 3)))
    batch = np.concatenate([np.roll(special, shift, axis=0) for shift in range(8)] * 20).astype(dtype)
    rotation = np.asarray(nearest_rotation(batch)).reshape(-1, 8, 3, 3)
    for row, shift in enumerate(list(range(8)) * 20):
        np.testing.assert_array_equal(np.roll(rotation[row], -shift, axis=0), rotation[0])


def test_entries_below_the_smallest_normal_number_count_as_zero():
    matrix = np.float32([[1e-37, 0, 0], [0, 0, -1e-38], [0, 1e-38, 0]])
    np.testing.assert_array_equal(nearest_rotation(matrix), np.eye(3))


def test_without_64_bit_types_a_float64_array_is_computed_in_float32(without_x64):
    assert nearest_rotation(np.eye(3, dtype=np.float64)).dtype == np.float32


@pytest.mark.parametrize("exponent", [-38, -25, 25, 38])
def test_a_matrix_written_into_the_program_may_have_any_size(exponent):
    """XLA multiplies constants in an order of its own: the product of two scaling factors would overflow."""
    size = np.float32(10) ** exponent
    for entries in (np.zeros((3, 3)), np.ones((3, 3)), np.diag([3.0, 2, 1])):
        matrix = entries.astype(np.float32) * size
        inside = jax.jit(lambda matrix=matrix: nearest_rotation(matrix))()
        np.testing.assert_allclose(inside.T @ inside, np.eye(3), atol=1e-6)
    filled = jax.jit(lambda: nearest_rotation(jnp.full((3, 3), size)))()
    np.testing.assert_allclose(filled.T @ filled, np.eye(3), atol=1e-6)
