"""The report as text, tables, a page and records."""
