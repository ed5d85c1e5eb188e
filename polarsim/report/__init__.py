"""What people read of a run: tables that papers quote, figures, one page of results."""
