"""The settings of jax that a command measures under."""

from collections.abc import Iterator
from contextlib import contextmanager

import jax


@contextmanager
def measuring_configuration() -> Iterator[None]:
    """Allows float64, and disables the compilation cache, which would shorten the measured compile times."""
    wanted = {"jax_enable_x64": True, "jax_enable_compilation_cache": False}
    before = {name: getattr(jax.config, name) for name in wanted}
    try:
        for name, value in wanted.items():
            jax.config.update(name, value)
        yield
    finally:
        for name, value in before.items():
            jax.config.update(name, value)
