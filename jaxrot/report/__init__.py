"""`python -m jaxrot report`: error against run time of every method, on real matrices.

`command` reads the options and `sections` measures all parts: `measurement` the methods, `beside` and `peers` other
packages, `warm_starts` the steps, `stability` and `guards` what breaks where and without what; `bench` the library's
own speed goals. `content` holds what came of it, `findings` and `comparison` say what it means, `drawing` and `writing`
make the files. `readme` fills the README. Nothing here is imported by the library itself.
"""
