"""The report as sentences, tables, pictures and files."""
