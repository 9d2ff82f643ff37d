"""NVIDIA Warp's `svd3` on one thread of the CPU, and on a GPU if there is one."""

# pyright: reportInvalidTypeForm=false
# Warp's kernels state their types as calls, which are no type expressions.

import importlib
from typing import Any

import numpy as np

from jaxrot.report.peers.peer import Peer, UnavailableError


def on_cpu(dtype: str) -> Peer:
    """The kernel compiled for the CPU."""
    return _peer("cpu", dtype)


def on_cuda(dtype: str) -> Peer:
    """The kernel on the first GPU."""
    return _peer("cuda:0", dtype)


def _peer(device: str, dtype: str) -> Peer:
    wp: Any = importlib.import_module("warp")
    # Otherwise Warp prints to standard output at its first use and at every compilation.
    wp.config.quiet, wp.config.log_level = True, wp.LOG_ERROR
    wp.init()
    if device != "cpu" and wp.get_cuda_device_count() == 0:
        raise UnavailableError("no CUDA device")
    matrix_type, vector_type = (wp.mat33f, wp.vec3f) if dtype == "float32" else (wp.mat33d, wp.vec3d)

    @wp.kernel(module="unique")
    def rotations(matrix: wp.array(dtype=matrix_type), rotation: wp.array(dtype=matrix_type)):
        left, values, right = matrix_type(), vector_type(), matrix_type()
        wp.svd3(matrix[wp.tid()], left, values, right)
        rotation[wp.tid()] = left @ wp.transpose(right)

    def launch(matrix: Any, rotation: Any) -> None:
        wp.launch(rotations, dim=len(matrix), inputs=[matrix], outputs=[rotation], device=device)

    def value(matrix: Any) -> Any:
        rotation = wp.empty_like(matrix, requires_grad=False)
        launch(matrix, rotation)
        wp.synchronize_device(device)
        return rotation

    def pullback(matrix: Any, rotation_bar: Any) -> tuple[Any, Any]:
        rotation = wp.empty_like(matrix, requires_grad=True)
        matrix.grad.zero_()
        tape = wp.Tape()
        with tape:
            launch(matrix, rotation)
        tape.backward(grads={rotation: rotation_bar})
        wp.synchronize_device(device)
        return rotation, matrix.grad

    def load(matrices: np.ndarray) -> Any:
        return wp.array(matrices, dtype=matrix_type, device=device, requires_grad=True)

    return Peer(load, value, pullback, lambda array: array.numpy(), 1, dtype)
