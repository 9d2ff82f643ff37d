"""`python -m jaxrot report`: error against run time of every method, on real matrices.

`command` reads the options, `measurement` runs everything, `findings`, `tables`, `pareto` and `output` say what came of
it. Nothing here is imported by the library itself.
"""
