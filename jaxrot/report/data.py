"""The record of everything that one report shows."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, NamedTuple

from jaxrot.report.comparison import Comparison
from jaxrot.report.inputs import Input
from jaxrot.report.measure.ablation_cost import Guards
from jaxrot.report.measure.peer_comparison import PeerComparison
from jaxrot.report.measure.results import Results
from jaxrot.report.measure.stability import ConditionMap, ScaleMap
from jaxrot.report.measure.warm_starts import WarmStart


class ReportData(NamedTuple):
    """Everything that the files and the terminal show. Parts that were not measured are empty or None."""

    given: Input  # The matrices
    dtypes: tuple[str, ...]  # "float32", "float64" or both
    results: Results  # Every method on the input and the families
    peers: PeerComparison | None = None  # The methods on jaxrot's front and the peers
    warm_starts: tuple[WarmStart, ...] = ()  # Every step
    conditions: tuple[ConditionMap, ...] = ()  # Stability over the singular values, one map for each dtype
    scales: tuple[ScaleMap, ...] = ()  # Stability over the scale, one map for each dtype
    guards: Guards | None = None  # What each guard costs and prevents
    comparison: Comparison | None = None  # With an earlier report
    environment: Mapping[str, str] = MappingProxyType({})  # The lines of the header
    options: Mapping[str, Any] = MappingProxyType({})  # The options of the command
