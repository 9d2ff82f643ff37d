"""Errors of rotations relative to wider arithmetic, and times in interleaved rounds, for reports and tests."""
