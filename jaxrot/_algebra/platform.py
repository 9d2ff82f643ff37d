"""The platform that a program is written for when it is traced."""

import jax


def platform() -> str:
    """The platform of JAX's default device: "cpu", "gpu", "tpu" or another one.

    A program that is then run elsewhere, as by `jax.export`, gives the same results; it is only cut for the wrong
    compiler.
    """
    device = jax.config.jax_default_device  # pyright: ignore[reportAttributeAccessIssue]
    if device is None:
        return jax.default_backend()
    return device if isinstance(device, str) else device.platform
