"""Figures of the report; each function reads files and writes PNG files."""
