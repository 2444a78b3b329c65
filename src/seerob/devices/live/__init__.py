"""What all live sources share: thread, back-off, clocks, real time."""
