"""Sources, recorded and live: whoever says where robots, machines and people are."""
