"""The measurements of the report: methods, peers, warm starts, stability, guards, speed goals."""
