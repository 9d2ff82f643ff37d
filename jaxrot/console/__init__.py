"""What the commands share: arguments, errors, Ctrl-C, output, tables, the progress display."""
