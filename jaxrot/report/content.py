"""Everything that one report has measured."""

from collections.abc import Mapping
from typing import Any, NamedTuple

from jaxrot.report.comparison import Comparison
from jaxrot.report.contenders import Beside
from jaxrot.report.guards.prices import Guards
from jaxrot.report.inputs import Input
from jaxrot.report.measurement import Results
from jaxrot.report.stability.cells import ConditionMap, ScaleMap
from jaxrot.report.warm_starts import WarmStart


class Content(NamedTuple):
    """What the files and the terminal are made of; parts that were not asked for are empty or None.

    Attributes:
        given: The matrices.
        environment: The header's lines.
        options: The options of the command.
        dtypes: "float32", "float64" or both.
        results: Every method on the input and the families.
        beside: jaxrot's front and its peers, where peers were asked for.
        warm_starts: Every step.
        conditions: Stability over the singular values, one map a dtype.
        scales: Stability over the scale, likewise.
        guards: What each guard costs and prevents.
        comparison: With an earlier report.
    """

    given: Input
    environment: Mapping[str, str]
    options: Mapping[str, Any]
    dtypes: tuple[str, ...]
    results: Results
    beside: Beside | None = None
    warm_starts: tuple[WarmStart, ...] = ()
    conditions: tuple[ConditionMap, ...] = ()
    scales: tuple[ScaleMap, ...] = ()
    guards: Guards | None = None
    comparison: Comparison | None = None
