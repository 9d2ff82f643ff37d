"""The suite catches what it is for: each mutant of the package fails the tests that it names."""

import os
import pathlib
import shutil
import subprocess
import sys
from typing import NamedTuple

import pytest

ROOT = pathlib.Path(__file__).parent.parent


class Mutant(NamedTuple):
    """A change of one line, and a test that must fail for it."""

    file: str
    original: str
    mutated: str
    test: str


LOWER = "test_derivative.py::test_the_derivative_of_each_order_is_that_of_the_lower_one[generic]"
KEPT = "test_methods.py::test_a_method_keeps_its_promise_on_every_family[float64-singular_pair-jit]"
CONTROL = "test_methods.py::test_the_controls_are_right_on_every_family_but_for_their_rounding[float64-svd]"
BOUNDED = "test_derivative.py::test_the_jacobian_is_finite_and_bounded_on_every_family[float64-forward]"
OF_THE_RULE = "test_derivative.py::test_the_second_derivative_is_of_the_rule_and_not_of_the_method[svd]"
DISTINCT = "test_svd.py::test_the_derivatives_are_right_where_singular_values_differ[generic]"
COMPRESSED = "test_jacobian.py::test_what_is_compressed_has_no_curvature_along_its_twists"
UNROLLED = "test_unrolled.py::test_both_derivatives_agree_at_convergence_and_not_before"
TORQUE = "test_refine.py::test_the_torque_iteration_turns_the_right_way_beyond_a_right_angle"
MUTANTS = {
    "sign of S": Mutant("_algebra/mat3.py", "[1][0]) * -0.5", "[1][0]) * 0.5", LOWER),
    "missing damping guard": Mutant("_derivative/rule.py", "_RESOLVED = 64", "_RESOLVED = 0", BOUNDED),
    "missing scale guard": Mutant(
        "_nearest.py", "solve(scaled(mat3.components(matrix)))", "solve(mat3.components(matrix))", KEPT
    ),
    "the angle the wrong way round": Mutant("solvers/singular_pair.py", "(s * e[1] - g[0])", "(g[0] - s * e[1])", KEPT),
    "raw solver in the rule": Mutant(
        "_nearest.py", "= nearest(matrix, method, damping, order + 1)", "= METHODS[method].solve(matrix)", OF_THE_RULE
    ),
    "no reflection fix": Mutant(
        "solvers/svd.py", "right[..., 2:, :] * sign[..., None, None]", "right[..., 2:, :]", CONTROL
    ),
    "singular vectors that turn the wrong way": Mutant(
        "_svd.py", "(s2 - s3, s3 - s1, s1 - s2)", "(s3 - s2, s1 - s3, s2 - s1)", DISTINCT
    ),
    "a Hessian that is not projected": Mutant(
        "_jacobian.py", "(1 / _at_least_two(gap) for", "(1 / gap for", COMPRESSED
    ),
    "unrolled that is not": Mutant("_refine.py", 'if derivative == "unrolled"', 'if derivative == ""', UNROLLED),
    "torque without the absolute value": Mutant(
        "steps/torque.py", "jnp.abs(mat3.trace(b)) + epsilon", "mat3.trace(b) + epsilon", TORQUE
    ),
}


@pytest.mark.exhaustive
@pytest.mark.parametrize("mutant", MUTANTS.values(), ids=MUTANTS.keys())
def test_a_mutant_is_caught(mutant, tmp_path):
    shutil.copytree(ROOT / "jaxrot", tmp_path / "jaxrot", ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copytree(ROOT / "tests", tmp_path / "tests", ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    file = tmp_path / "jaxrot" / mutant.file
    source = file.read_text()
    assert source.count(mutant.original) == 1
    file.write_text(source.replace(mutant.original, mutant.mutated))
    test = str(tmp_path / "tests" / mutant.test)
    environment = {name: value for name, value in os.environ.items() if not name.startswith("PYTEST_")}
    run = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-x", "-n0", "-m", "", "-p", "no:cacheprovider", test],
        cwd=tmp_path,
        env=environment | {"PYTHONPATH": str(tmp_path), "JAX_COMPILATION_CACHE_DIR": str(ROOT / ".jax_cache")},
        capture_output=True,
        text=True,
        check=False,
    )
    # 1: tests ran and some failed. Anything else, no test found for one, is no catch.
    assert run.returncode == 1, run.stdout[-2000:]
    assert "1 failed" in run.stdout
    assert "ImportError" not in run.stdout
