"""Pictures of error against time."""
