"""`python -m jaxrot report`: error against run time of every method, on real matrices.

`command` reads the options into a `plan`, and `run` measures all of it on the `inputs`. `measure` holds the
measurements, and `peers` the other packages to compare with. `data` is the record of the results, and `comparison`
compares it with an earlier report. `show` makes sentences, tables, pictures and files. `readme` fills the README. The
library itself imports nothing from here.
"""
