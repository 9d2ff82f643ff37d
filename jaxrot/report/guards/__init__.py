"""What every guard of the default method and of the steps costs and prevents."""
