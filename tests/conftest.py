"""Settings under which every test runs: as strict as a caller may be."""

import os
import pathlib

# Each program from the cache is announced on stderr with its processor features; that would bury a failure.
os.environ.setdefault("TF_CPP_MIN_LOG_LEVEL", "3")

import jax
import pytest

jax.config.update("jax_enable_x64", True)
jax.config.update("jax_numpy_dtype_promotion", "strict")
jax.config.update("jax_numpy_rank_promotion", "raise")
# Sharding is tested on simulated devices; everything else runs on the first.
jax.config.update("jax_num_cpu_devices", 8)
# Compilation is what the suite spends its time on, and each of its processes compiles much the same.
jax.config.update("jax_compilation_cache_dir", str(pathlib.Path(__file__).parent.parent / ".jax_cache"))
jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.1)


@pytest.fixture(autouse=True, scope="module")
def _programs_are_freed():
    """A process may hold 65,530 memory maps on Linux, a compiled program takes dozens, and JAX keeps all of them."""
    yield
    jax.clear_caches()


@pytest.fixture(params=["float32", "float64"])
def dtype(request):
    """A test that names it runs in both."""
    return request.param


@pytest.fixture
def without_x64():
    jax.config.update("jax_enable_x64", False)
    yield
    jax.config.update("jax_enable_x64", True)
