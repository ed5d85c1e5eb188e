"""One file an outside format, its reader beside its writer."""
