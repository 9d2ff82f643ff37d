"""Scenes in which rotations are extracted at every step: pure `step(state, parameters) -> state`."""
