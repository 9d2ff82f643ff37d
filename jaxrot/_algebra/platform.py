"""The platform for which a program is optimised while it is traced."""

import jax


def platform() -> str:
    """The platform of JAX's default device: "cpu", "gpu", "tpu" or another one.

    A program that runs on another platform, for example after `jax.export`, gives the same results. It is only
    optimised for the wrong compiler.
    """
    device = jax.config.jax_default_device  # pyright: ignore[reportAttributeAccessIssue]
    if device is None:
        return jax.default_backend()
    return device if isinstance(device, str) else device.platform
