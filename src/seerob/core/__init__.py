"""What everything speaks: samples, snapshots, verdicts, markers, units, errors."""
