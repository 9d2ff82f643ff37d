"""Complex numbers as pairs of real arrays, which XLA fuses like other real arithmetic."""

import jax

Complex = tuple[jax.Array, jax.Array]  # real and imaginary part


def times(a: Complex, real: jax.Array) -> Complex:
    """The number times a real one."""
    return a[0] * real, a[1] * real


def add(a: Complex, b: Complex) -> Complex:
    """The sum."""
    return a[0] + b[0], a[1] + b[1]


def subtract(a: Complex, b: Complex) -> Complex:
    """The difference."""
    return a[0] - b[0], a[1] - b[1]


def multiply(a: Complex, b: Complex) -> Complex:
    """The product."""
    return a[0] * b[0] - a[1] * b[1], a[0] * b[1] + a[1] * b[0]


def square(a: Complex) -> jax.Array:
    """The squared modulus."""
    return a[0] * a[0] + a[1] * a[1]


def reciprocal(a: Complex) -> Complex:
    """One over the number."""
    norm = square(a)
    return a[0] / norm, -a[1] / norm


def divide(a: Complex, b: Complex) -> Complex:
    """The quotient."""
    norm = square(b)
    return (a[0] * b[0] + a[1] * b[1]) / norm, (a[1] * b[0] - a[0] * b[1]) / norm
