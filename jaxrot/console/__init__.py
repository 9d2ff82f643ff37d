"""What the commands share: their arguments, their errors, Ctrl-C, what they print and write, the progress bar."""
