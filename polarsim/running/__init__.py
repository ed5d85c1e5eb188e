"""Execution of the workflow by `polarsim run`: checks, start, interruption, resumption and reports."""
