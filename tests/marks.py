"""Parameters of which most take part in the exhaustive run alone."""

import pytest


def mostly_exhaustive(cases, *default):
    """All of the cases, each a value or a tuple, marked `exhaustive` but for the default ones."""
    values = {case: case if isinstance(case, tuple) else (case,) for case in cases}
    return [pytest.param(*values[x], marks=[] if x in default else pytest.mark.exhaustive) for x in values]
