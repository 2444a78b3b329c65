"""From a workstation file to one MuJoCo model: robots, machines, people, things and areas."""
