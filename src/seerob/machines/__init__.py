"""Machines that follow variables: conveyors, axes, doors; and what is shown of a variable."""
