"""What the compilers for a TPU and for an H100 make of the programs, ahead of time and without either.

Each test runs where its compiler is installed: `pip install "jax[tpu]"` or `pip install "jax[cuda12]"`, in an
environment of its own together with the test extra, then `pytest -m exhaustive tests/test_ahead_of_time.py`.
"""

import importlib.util
import json
import math
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

COMMON = """
import json
import jax, jax.numpy as jnp
from jax.experimental import topologies
from jax.sharding import SingleDeviceSharding
from jaxrot import nearest_rotation, refine_rotation

PROGRAMS = {
    "value": (nearest_rotation, 1),
    "pullback": (lambda a, bar: jax.vjp(nearest_rotation, a)[1](bar), 2),
    "step": (lambda a, start: refine_rotation(a, start, iterations=1), 2),
}
COUNT = 1 << 20

def compile(name, described):
    function, inputs = PROGRAMS[name]
    matrix = jax.ShapeDtypeStruct((COUNT, 3, 3), jnp.float32, sharding=SingleDeviceSharding(described.devices[0]))
    return jax.jit(function).lower(*[matrix] * inputs).compile()
"""

TPU = """
jax.default_backend = lambda: "tpu"
described = topologies.get_topology_desc("v5e:1x1", platform="tpu", chips_per_host_bounds=[1, 1, 1])
print(json.dumps({name: compile(name, described).cost_analysis()["bytes accessed"] / COUNT for name in PROGRAMS}))
"""

# What XLA has to know of an H100 SXM, in the words of its `GpuTargetConfigProto`.
H100 = """
jax.default_backend = lambda: "gpu"
target = '''
gpu_device_info {
  threads_per_block_limit: 1024 threads_per_warp: 32 shared_memory_per_block: 49152 shared_memory_per_core: 233472
  threads_per_core_limit: 2048 core_count: 132 fpus_per_core: 128 block_dim_limit_x: 2147483647
  block_dim_limit_y: 65535 block_dim_limit_z: 65535 memory_bandwidth: 3352320000000 l2_cache_size: 52428800
  clock_rate_ghz: 1.98 device_memory_size: 84942979072 shared_memory_per_block_optin: 232448
  cuda_compute_capability { major: 9 } registers_per_core_limit: 65536 registers_per_block_limit: 65536
}
platform_name: "CUDA"
dnn_version_info { major: 9 minor: 8 patch: 0 }
device_description_str: "NVIDIA H100 80GB HBM3"
'''
compile(NAME, topologies.get_topology_desc(platform="cuda", target_config=target, topology="1x1x1"))
"""


def run(program, **environment):
    """Runs the program with the environment and returns what it printed."""
    environment = os.environ | {"JAX_PLATFORMS": "cpu"} | environment
    done = subprocess.run(
        [sys.executable, "-c", COMMON + program], env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr[-2000:]
    return done.stdout


@pytest.mark.exhaustive
@pytest.mark.skipif(importlib.util.find_spec("libtpu") is None, reason="libtpu is not installed")
def test_a_tpu_reads_and_writes_few_bytes_a_matrix():
    alone = {"TPU_SKIP_MDS_QUERY": "1", "TPU_WORKER_HOSTNAMES": "localhost", "ALLOW_MULTIPLE_LIBTPU_LOAD": "1"}
    printed = run(TPU, TPU_ACCELERATOR_TYPE="v5litepod-1", **alone)
    accessed = json.loads(printed.splitlines()[-1])
    assert accessed["value"] < 900
    assert accessed["pullback"] < 1600
    assert accessed["step"] < 1600


def cuda_folder():
    """The folder of NVIDIA's packages that holds bin/ptxas, or nothing."""
    found = importlib.util.find_spec("nvidia")
    folders = found.submodule_search_locations if found and found.submodule_search_locations else []
    tools = [tool for folder in folders for tool in sorted(Path(folder).glob("**/bin/ptxas"))]
    return tools[0].parent.parent if tools else None


@pytest.mark.exhaustive
@pytest.mark.skipif(cuda_folder() is None, reason="jax[cuda12] is not installed")
@pytest.mark.parametrize(("name", "most"), [("value", 800), ("pullback", 1500), ("step", 1000)])
def test_an_h100_computes_each_matrix_once(name, most, tmp_path):
    """PTX instructions a matrix. The kernel that joins the entries would otherwise compute the matrix nine times."""
    run(f"NAME = {name!r}" + H100, XLA_FLAGS=f"--xla_dump_to={tmp_path} --xla_gpu_cuda_data_dir={cuda_folder()}")
    kernels = [part for path in tmp_path.glob("*.ptx") for part in path.read_text().split(".entry ")[1:]]
    counts = {
        kernel.split("(", 1)[0]: len(re.findall(r"^\s+(?:@!?%p\d+ )?[a-z]\w*[\w.:]*\s[^;]*;", kernel, re.MULTILINE))
        for kernel in kernels
    }
    schedule = next(tmp_path.glob("*thunk_sequence.txt")).read_text()
    launched = re.findall(r"kCustomKernel .*?\] (\w+) grid: \[([\d, ]+)\] threads: \[([\d, ]+)\]", schedule)
    assert launched
    threads = [math.prod(map(int, f"{grid}, {block}".split(", "))) for _, grid, block in launched]
    per_matrix = sum(counts[kernel] * number for (kernel, _, _), number in zip(launched, threads, strict=True)) / 2**20
    assert 100 < per_matrix < most
