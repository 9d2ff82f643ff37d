"""Evaluates a function of JAX in NumPy, primitive by primitive, in the arithmetic of a chosen machine."""

from collections.abc import Callable, Sequence

import jax
import numpy as np
from arithmetic.machines import Machine
from jax.extend import core

_CALLS = ("jit", "pjit", "closed_call", "custom_jvp_call", "custom_vjp_call", "remat", "checkpoint")


def evaluate(function: Callable, arrays: Sequence[np.ndarray], machine: Machine) -> list[np.ndarray]:
    """The leaves of what the function returns for float32 arrays, as the machine computes them."""
    # A new function each time: JAX must not hand back the trace of another machine.
    closed = jax.make_jaxpr(lambda *given: jax.tree.leaves(function(*given)))(*arrays)
    with np.errstate(all="ignore"):
        return _Interpreter(machine).run(closed, list(arrays))


class _Interpreter:
    def __init__(self, machine: Machine) -> None:
        self._machine = machine
        # What an array was before it was rounded, where it is a product: what a fused sum adds to.
        self._products: dict[int, tuple[np.ndarray, np.ndarray]] = {}

    def run(self, closed: core.ClosedJaxpr, arrays: Sequence[np.ndarray]) -> list[np.ndarray]:
        jaxpr = closed.jaxpr
        values = dict(zip(jaxpr.constvars, map(np.asarray, closed.consts), strict=True))
        values |= dict(zip(jaxpr.invars, arrays, strict=True))

        def read(variable) -> np.ndarray:
            if isinstance(variable, core.Literal):
                return np.asarray(variable.val, variable.aval.dtype)
            return values[variable]

        for equation in jaxpr.eqns:
            results = self._apply(equation.primitive.name, [read(v) for v in equation.invars], equation.params)
            for variable, result in zip(equation.outvars, results, strict=True):
                if result.dtype != variable.aval.dtype or result.shape != variable.aval.shape:
                    result = np.broadcast_to(result.astype(variable.aval.dtype), variable.aval.shape)
                values[variable] = result
        return [read(variable) for variable in jaxpr.outvars]

    def _apply(self, name: str, values: list[np.ndarray], parameters: dict) -> Sequence[np.ndarray]:
        if name in _CALLS:
            return self.run(parameters.get("jaxpr") or parameters["call_jaxpr"], values)
        if name == "scan":
            return self._scan(values, parameters)
        flush = self._machine.flush
        values = [flush(value) for value in values] if name not in _SHAPES else values
        x = values[0]
        if x.dtype == np.float32 and name in ("add", "sub", "add_any"):
            return [flush(self._sum(*values, -1 if name == "sub" else 1))]
        if x.dtype == np.float32 and name == "mul":
            product = flush(x * values[1])
            if self._machine.fuses:
                # With the array itself, so that its identity is not used again.
                self._products[id(product)] = product, x.astype(np.float64) * values[1]
            return [product]
        if x.dtype == np.float32 and name == "div":
            return [flush(self._machine.divide(*np.broadcast_arrays(*values)))]
        if name in ("sqrt", "rsqrt"):
            root = self._machine.root(x)
            return [flush(root if name == "sqrt" else self._machine.divide(np.ones_like(root), root))]
        if name in ("sin", "cos", "atan2", "exp", "log"):
            function = {"atan2": np.arctan2}.get(name) or getattr(np, name)
            return [flush(function(*(value.astype(np.float64) for value in values)).astype(np.float32))]
        if name in _EXACT:
            return [np.asarray(_EXACT[name](*values))]
        return _SHAPES[name](values, parameters)

    def _sum(self, a: np.ndarray, b: np.ndarray, sign: int) -> np.ndarray:
        if id(b) in self._products:
            return (a + sign * self._products[id(b)][1]).astype(np.float32)
        if id(a) in self._products:
            return (self._products[id(a)][1] + sign * b.astype(np.float64)).astype(np.float32)
        return a + np.float32(sign) * b

    def _scan(self, values: list[np.ndarray], parameters: dict) -> list[np.ndarray]:
        """A loop of fixed length that carries everything, as `fori_loop` makes."""
        count = len(values) - len(parameters["jaxpr"].jaxpr.outvars)
        constants, carry = values[:count], values[count:]
        for _ in range(parameters["length"]):
            carry = self.run(parameters["jaxpr"], [*constants, *carry])
        return carry


_EXACT: dict[str, Callable] = {
    "add": np.add, "sub": np.subtract, "mul": np.multiply, "div": np.floor_divide, "neg": np.negative, "abs": np.abs,
    "sign": np.sign, "max": np.maximum, "min": np.minimum, "lt": np.less, "le": np.less_equal, "gt": np.greater,
    "ge": np.greater_equal, "eq": np.equal, "ne": np.not_equal, "and": np.bitwise_and, "or": np.bitwise_or,
    "xor": np.bitwise_xor, "not": np.invert, "shift_left": np.left_shift, "shift_right_arithmetic": np.right_shift,
    "is_finite": np.isfinite, "square": np.square, "stop_gradient": np.asarray, "copy": np.asarray,
    "clamp": lambda low, x, high: np.clip(x, low, high),
    "select_n": lambda which, *cases: np.choose(which.astype(int), cases),
}  # fmt: skip


def _slice(values: list[np.ndarray], parameters: dict) -> list[np.ndarray]:
    bounds = zip(parameters["start_indices"], parameters["limit_indices"], strict=True)
    assert parameters["strides"] is None
    return [values[0][tuple(slice(*bound) for bound in bounds)]]


def _broadcast(values: list[np.ndarray], parameters: dict) -> list[np.ndarray]:
    shape = [1] * len(parameters["shape"])
    for place, size in zip(parameters["broadcast_dimensions"], values[0].shape, strict=True):
        shape[place] = size
    return [np.broadcast_to(values[0].reshape(shape), parameters["shape"])]


def _pad(values: list[np.ndarray], parameters: dict) -> list[np.ndarray]:
    widths = [(low, high) for low, high, _ in parameters["padding_config"]]
    return [np.pad(values[0], widths, constant_values=values[1])]


def _power(values: list[np.ndarray], parameters: dict) -> list[np.ndarray]:
    result = values[0]
    for _ in range(parameters["y"] - 1):
        result = result * values[0]
    return [result]


# What moves numbers and computes nothing.
_SHAPES: dict[str, Callable[[list[np.ndarray], dict], Sequence[np.ndarray]]] = {
    "slice": _slice,
    "broadcast_in_dim": _broadcast,
    "pad": _pad,
    "integer_pow": _power,
    "split": lambda v, p: np.split(v[0], np.cumsum(p["sizes"])[:-1], p["axis"]),
    "unstack": lambda v, p: list(np.moveaxis(v[0], p["axis"], 0)),
    "squeeze": lambda v, p: [np.squeeze(v[0], p["dimensions"])],
    "expand_dims": lambda v, p: [np.expand_dims(v[0], p["dimensions"])],
    "reshape": lambda v, p: [v[0].reshape(p["new_sizes"])],
    "transpose": lambda v, p: [np.transpose(v[0], p["permutation"])],
    "stack": lambda v, p: [np.stack(v, p["axis"])],
    "concatenate": lambda v, p: [np.concatenate(v, p["dimension"])],
    "rev": lambda v, p: [np.flip(v[0], p["dimensions"])],
    "convert_element_type": lambda v, p: [v[0].astype(p["new_dtype"])],
    "bitcast_convert_type": lambda v, p: [np.ascontiguousarray(v[0]).view(p["new_dtype"])],
    "optimization_barrier": lambda v, p: v,
}
