"""Error and time of a rotation: judged against a wider arithmetic, timed side by side.

The tests, `recommend` and the report share it; no result of the library depends on it.
"""
