"""What sources of ROS share."""
