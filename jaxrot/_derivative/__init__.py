"""The derivative rule of the nearest rotation, and how its scale stays within the range of the dtype."""
