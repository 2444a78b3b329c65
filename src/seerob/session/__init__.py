"""A run from file to results; batches, permissible speeds, plans."""
