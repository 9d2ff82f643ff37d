"""Parameters of which most take part in the exhaustive run alone."""

import pytest


def mostly_exhaustive(names, *default):
    """All of the names, marked `exhaustive` but for the default ones."""
    return [name if name in default else pytest.param(name, marks=pytest.mark.exhaustive) for name in names]
