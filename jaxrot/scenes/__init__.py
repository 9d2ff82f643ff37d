"""Simulations that extract rotations in every step, each with a pure `step(state, parameters) -> state`."""
