"""What ROS says, and the wires on which it says it."""
