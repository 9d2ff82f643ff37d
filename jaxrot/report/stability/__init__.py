"""Error and failures of every method over singular values, scale, and stiff and extreme cases."""
