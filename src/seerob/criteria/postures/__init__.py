"""What rules about postures share: the angles of the twin, zones, phases of the task."""
