"""Machines that follow variables: conveyors, axes, doors, grippers."""
