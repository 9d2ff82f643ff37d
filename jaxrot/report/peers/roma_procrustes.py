"""RoMa, on PyTorch's CPU."""

import importlib
from typing import Any

import numpy as np

from jaxrot.report.peers.peer import Peer


def svd(dtype: str) -> Peer:
    """`special_procrustes` by PyTorch's singular value decomposition."""
    return _peer("svd", dtype)


def horn(dtype: str) -> Peer:
    """`special_procrustes` by a closed form, which computes in float64."""
    return _peer("horn", "float64")


def _peer(method: str, computes_in: str) -> Peer:
    roma: Any = importlib.import_module("roma")
    torch: Any = importlib.import_module("torch")

    def value(matrix: Any) -> Any:
        with torch.no_grad():
            return roma.special_procrustes(matrix, method=method)

    def pullback(matrix: Any, rotation_bar: Any) -> tuple[Any, Any]:
        variable = matrix.detach().requires_grad_()
        rotation = roma.special_procrustes(variable, method=method)
        return rotation, torch.autograd.grad(rotation, variable, rotation_bar)[0]

    def load(matrices: np.ndarray) -> Any:
        return torch.from_numpy(np.array(matrices))

    return Peer(load, value, pullback, lambda tensor: tensor.detach().numpy(), torch.get_num_threads(), computes_in)
