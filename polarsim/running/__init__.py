"""One command that starts the workflow, and goes on where a run was stopped: `polarsim run`."""
