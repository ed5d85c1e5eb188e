"""Figures of the report; each function reads files and writes one or two PNG files."""
