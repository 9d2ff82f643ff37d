"""What the compiler for a TPU makes of the programs, ahead of time and without one.

It runs where libtpu is installed, in an environment with `pip install "jax[tpu]"` beside the test extra.
"""

import importlib.util
import json
import os
import subprocess
import sys

import pytest

PROGRAM = """
import json
import jax, jax.numpy as jnp
from jax.experimental import topologies
from jax.sharding import SingleDeviceSharding
from jaxrot import nearest_rotation, refine_rotation

jax.default_backend = lambda: "tpu"
described = topologies.get_topology_desc("v5e:1x1", platform="tpu", chips_per_host_bounds=[1, 1, 1])
count = 1 << 20
matrix = jax.ShapeDtypeStruct((count, 3, 3), jnp.float32, sharding=SingleDeviceSharding(described.devices[0]))
programs = {
    "value": (nearest_rotation, 1),
    "pullback": (lambda a, bar: jax.vjp(nearest_rotation, a)[1](bar), 2),
    "step": (lambda a, start: refine_rotation(a, start, iterations=1), 2),
}
found = {}
for name, (function, inputs) in programs.items():
    compiled = jax.jit(function).lower(*[matrix] * inputs).compile()
    found[name] = compiled.cost_analysis()["bytes accessed"] / count
print(json.dumps(found))
"""


@pytest.mark.exhaustive
@pytest.mark.skipif(importlib.util.find_spec("libtpu") is None, reason="libtpu is not installed")
def test_a_tpu_reads_and_writes_few_bytes_a_matrix():
    environment = os.environ | {
        "JAX_PLATFORMS": "cpu",
        "TPU_SKIP_MDS_QUERY": "1",
        "TPU_ACCELERATOR_TYPE": "v5litepod-1",
        "TPU_WORKER_HOSTNAMES": "localhost",
        "ALLOW_MULTIPLE_LIBTPU_LOAD": "1",
    }
    run = subprocess.run([sys.executable, "-c", PROGRAM], env=environment, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr[-2000:]
    accessed = json.loads(run.stdout.splitlines()[-1])
    assert accessed["value"] < 900
    assert accessed["pullback"] < 1600
    assert accessed["step"] < 1600
