"""`python -m jaxrot recommend`: the cheapest method or step for a file of matrices, and the runners-up."""
