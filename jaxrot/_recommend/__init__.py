"""`recommend`: the sample, the candidates, and the result."""
